"""Plain states of Concurrences and Iterators, each under an oracle of its own."""
