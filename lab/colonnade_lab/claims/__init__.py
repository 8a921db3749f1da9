"""The paper in one command (``make paper``): each claim of the source paper against ``docs/paper.md``.

`checks` has the claims: each runs commands in a cheap form and compares what they measure with the data of the page.
`full` measures the page's data again and compares all its tables. `plots` draws the paper's figures from the data,
`page` writes them and the outcome as one HTML file.
"""
