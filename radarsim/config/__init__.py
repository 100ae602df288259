"""From YAML to checked, frozen objects; every fault is reported with its file, line, column and key."""
