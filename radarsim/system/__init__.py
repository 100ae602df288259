"""The machine: whether threads may be started, and files to which only the user may write."""
