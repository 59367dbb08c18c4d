"""The samples of a dataset as every stage after their producer sees them, and how a stage joins in.

A stage declares up to four things, each in a file of its folder, where they are discovered:

- `producer.py`, `PRODUCER`: this stage makes samples. It says which config keys ask for them, and what the card says.
- `language.py`, `LANGUAGE`: what a sample is, and how it becomes a `Shape`.
- `members.py`, `MEMBERS`: this stage adds members, or fields of the record, to every sample.
- `audit.py`, `AUDIT`: how `make verify` checks what this stage made, once the dataset is finished.
"""
