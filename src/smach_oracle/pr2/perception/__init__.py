"""What the head camera sees: tables, objects, the refrigerator's door."""
