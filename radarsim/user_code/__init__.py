"""The user's code: which modules and files it is made of, hashes of its sources, its errors in one line."""
