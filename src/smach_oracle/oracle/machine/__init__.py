"""One wrapped machine, its records, settings and userdata, and the places of its whole tree."""
