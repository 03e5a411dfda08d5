# For those who type make; the scripts do the work.
.PHONY: demo test setup
demo test setup:
	@scripts/$@
