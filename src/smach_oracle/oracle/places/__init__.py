"""Places, the states of all containers of a tree, and the ways between them."""
