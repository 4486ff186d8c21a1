"""Sound bags of plain messages, read by `struct` and their index alone: for speed."""
