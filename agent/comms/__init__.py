"""What an agent knows of the others: neighbours heard, knowledge passed on, places shared out."""
