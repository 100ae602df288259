"""The machine: whether threads may be started, directories, and files to which only the user may write."""
