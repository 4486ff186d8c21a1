"""What bags and stores may take of a disk: what goes is named first."""
