"""The samples of a dataset as every stage after their producer sees them, and how the rest of the house joins in.

Four things are declared, each in a file of a stage's folder, and found there:

- `producer.py`, `PRODUCER`: this stage makes samples. Says what in a config asks for it, and what a card says of it.
- `language.py`, `LANGUAGE`: what a sample is, and how it becomes a `Shape`.
- `members.py`, `MEMBERS`: this stage adds members, or fields of the record, to every sample.
- `audit.py`, `AUDIT`: how `make verify` looks at what was made here, once it is finished.
"""
