"""Finished sums on disk: their files, who reads, writes, counts and checks them."""
