"""The claims of P3 on manoeuvres."""
