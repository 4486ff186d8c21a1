"""What a trial leaves in a store while it runs, and how a machine goes on from that."""
