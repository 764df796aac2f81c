"""What a campaign leaves on disk and shows."""
