"""Whether two paths are the same in space, however they are divided into elements."""

import math

# Paths are the same up to this.
SAME_MM = 1e-5


def same(one, other, allowed_mm=SAME_MM):
    """None, or where one path leaves the other: in space, in order, and rapid where it is."""
    ways = [[piece for piece in path if piece.length > 1e-6] for path in (one, other)]
    for way, beside in (ways, ways[::-1]):
        reached = 0
        for piece in way:
            for part in (0.0, 0.1, 0.3, 0.5, 0.7, 0.9, 1.0):
                point = piece.at(part)
                near = math.inf
                for number in range(reached, len(beside)):
                    near = min(near, beside[number].distance(point))
                    if near <= allowed_mm:
                        break
                else:
                    place = " ".join(f"{axis}{value:.4f}" for axis, value in zip("XYZ", point))
                    return f"{near:.6f} mm apart at {place}"
                reached = number
                if part != 0.5:
                    continue
                # Where a path goes back over itself, it may be one of the next moves as well.
                at = [number for number, it in enumerate(beside[reached:reached + 4], reached)
                      if it.is_rapid == piece.is_rapid and it.distance(point) <= allowed_mm]
                if not at:
                    return f"a rapid in one of them only, at block {piece.block}"
                reached = at[0]
    lengths = [sum(piece.length for piece in way) for way in ways]
    # At a joint that is off by little, both may be longer by more.
    more_mm = allowed_mm if allowed_mm == SAME_MM else math.sqrt(allowed_mm)
    if abs(lengths[0] - lengths[1]) > 2.0 * sum(map(len, ways)) * more_mm:
        return f"{lengths[0]:.6f} and {lengths[1]:.6f} mm long"
    return None
