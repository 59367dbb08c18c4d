"""What a config requires of a variant: hubs, labels and global constraints, and how parts are resized to meet these."""
