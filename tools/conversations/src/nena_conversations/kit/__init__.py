"""Test a robot against VDA 5050, clause by clause: act as its fleet control, and judge what it does."""
