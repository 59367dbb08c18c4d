"""What a config leaves open, decided: up axis, contacts, grammar and hubs, by geometry and a short search."""
