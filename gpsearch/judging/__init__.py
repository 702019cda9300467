"""What a run found, judged: its models beside each other, their images, and which of them a scene needs."""
