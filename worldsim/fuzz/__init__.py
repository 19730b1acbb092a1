"""`qswarm fuzz` and `qswarm cause`: many trials flown, findings kept, made small and explained."""
