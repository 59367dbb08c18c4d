"""The five papers: what they publish, what we get, and what makes it again.

One file a paper, `<paper>.yaml`, is the source of `eval/RESULTS.md` and of the reports of `make paper`.
"""
