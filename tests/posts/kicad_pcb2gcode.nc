( pcb2gcode 2.5.0 )
( Software-independent Gcode )

G94 ( Millimeters per minute feed rate. )
G21 ( Units == Millimeters. )

G90 ( Absolute coordinates.        )
G00 S30000     ( RPM spindle speed.           )
G64 P0.00400 ( set maximum deviation from commanded toolpath )
G01 F200.00000 ( Feedrate. )

G00 Z5.00000 (retract)

M3 ( Spindle on clockwise.        )
G04 P0.00000 ( Wait for spindle to get up to speed )
G00 X1.00000 Y1.00000 ( rapid move to begin. )
G01 F60.00000
G01 Z-0.05000
G04 P0 ( dwell for no time -- G64 should not smooth over this point )
G01 F200.00000
G01 X2.00000 Y1.00000

G04 P0 ( dwell for no time -- G64 should not smooth over this point )
G00 Z35.000 ( retract )

M5 ( Spindle off. )
G04 P1.000000
M9 ( Coolant off. )
M2 ( Program end. )
