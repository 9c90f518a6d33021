(error modal_conflict 2:5)
G41 G42
M30
