"""From YAML to checked, frozen objects; every fault told with its file, line, column and key."""
