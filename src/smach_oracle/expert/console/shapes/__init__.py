"""The shapes of all that the console sends to its pages.

`python3 doc/write_page_types.py` makes the declarations of the page's scripts from them.
"""
