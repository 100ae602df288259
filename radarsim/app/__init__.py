"""What the command and Python share: run, result, outlook, claims, doctor, clean, reproduce."""
