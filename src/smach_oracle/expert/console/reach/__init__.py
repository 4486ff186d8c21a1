"""Calls people who do not look at a page: by webhook and by e-mail, from an on-call list."""
