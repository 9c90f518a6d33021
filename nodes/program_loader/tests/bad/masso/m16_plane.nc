(error plane 3:1)
G18
G41
G0 X0
M30
