"""What the command line and the Python functions share: run, result, outlook, claims, doctor, clean, reproduce."""
