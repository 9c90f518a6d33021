"""Expressions: text, and the value as far as it must be known to stay in the domain."""

import math

# From strongest to weakest; from left to right in each.
LEVELS = [["**"], ["*", "/", "MOD"], ["+", "-"], ["EQ", "NE", "GT", "GE", "LT", "LE"],
          ["AND", "OR", "XOR"]]
NEARLY = 1e-6


def apply(operator, a, b):
    """The value, or None where there is none or it is too large to be of use."""
    if operator == "**":
        if a < 0.0 and b != round(b) or a == 0.0 and b < 0.0 or abs(b) > 6.0:
            return None
        value = a ** b
    elif operator == "*":
        value = a * b
    elif operator in ("/", "MOD"):
        if abs(b) < 0.01:
            return None
        value = a / b if operator == "/" else math.fmod(a, b)
        if operator == "MOD" and value < 0.0:
            value += abs(b)
    elif operator == "+":
        value = a + b
    elif operator == "-":
        value = a - b
    elif operator in ("AND", "OR", "XOR"):
        one, two = a != 0.0, b != 0.0
        value = float({"AND": one and two, "OR": one or two, "XOR": one != two}[operator])
    else:
        # Nearly equal values are no test.
        if 0.0 < abs(a - b) < NEARLY:
            return None
        value = float({"EQ": a == b, "NE": a != b, "GT": a > b, "GE": a >= b, "LT": a < b,
                       "LE": a <= b}[operator])
    return value if abs(value) < 1e5 else None


def flat(rng, terms):
    """Terms and operators without brackets; the text and the value, or None."""
    operators = [rng.choice(rng.choice(LEVELS)) for _ in terms[1:]]
    text = terms[0][0]
    for operator, term in zip(operators, terms[1:]):
        blank = " " if operator.isalpha() or rng.random() < 0.5 else ""
        text += f"{blank}{cased(rng, operator)}{blank}{term[0]}"
    values = [value for _, value in terms]
    for level in LEVELS:
        n = 0
        while n < len(operators):
            if operators[n] in level:
                value = apply(operators[n], values[n], values[n + 1])
                if value is None:
                    return None
                values[n:n + 2] = [value]
                del operators[n]
            else:
                n += 1
    return text, values[0]


def cased(rng, word):
    return rng.choice([word, word, word.lower(), word.capitalize()])


def number(rng):
    value = rng.choice([
        float(rng.randint(-9, 9)), rng.randint(-999, 999) / 100.0, rng.randint(0, 99) / 10.0,
        rng.randint(1, 99999) / 1000.0])
    return written(rng, value), value


def written(rng, value, sign=True):
    """A number in one of the ways to write it."""
    text = f"{abs(value):.4f}".rstrip("0")
    if text.startswith("0.") and len(text) > 2 and rng.random() < 0.5:
        text = text[1:]
    elif rng.random() < 0.1:
        text = "0" + text
    if text.endswith(".") and rng.random() < 0.6:
        text = text[:-1]
    if value < 0.0:
        return "-" + text
    return "+" + text if sign and rng.random() < 0.05 else text


def function(rng, name, x):
    """A function of a term, kept in its domain: text and value, or None."""
    text, value = x
    call = cased(rng, name)
    if name == "ATAN":
        other = number(rng)
        if value == 0.0 == other[1]:
            return None
        return f"{call}[{text}]/[{other[0]}]", math.degrees(math.atan2(value, other[1]))
    if name in ("ASIN", "ACOS"):
        if abs(value) > 1.0:
            text, value = f"SIN[{text}]", math.sin(math.radians(value))
        inverse = math.asin if name == "ASIN" else math.acos
        return f"{call}[{text}]", math.degrees(inverse(max(-1.0, min(1.0, value))))
    if name == "TAN" and abs(math.cos(math.radians(value))) < 0.05:
        return None
    if name == "SQRT" and value < 0.0 or name == "LN" and value <= 0.001:
        text, value = f"[ABS[{text}] + 0.5]", abs(value) + 0.5
    if name == "EXP" and value > 6.0:
        return None
    # Where rounding decides.
    near = abs(value - round(value))
    if name in ("FIX", "FUP") and 0.0 < near < NEARLY:
        return None
    if name == "ROUND" and abs(near - 0.5) < NEARLY and value * 4.0 != round(value * 4.0):
        return None
    result = {
        "SIN": lambda: math.sin(math.radians(value)), "COS": lambda: math.cos(math.radians(value)),
        "TAN": lambda: math.tan(math.radians(value)), "ABS": lambda: abs(value),
        "FIX": lambda: math.floor(value), "FUP": lambda: math.ceil(value),
        "ROUND": lambda: math.floor(abs(value) + 0.5) * math.copysign(1.0, value),
        "SQRT": lambda: math.sqrt(value), "LN": lambda: math.log(value),
        "EXP": lambda: math.exp(value)}[name]()
    return (f"{call}[{text}]", float(result)) if abs(result) < 1e5 else None


FUNCTIONS = ["ATAN", "ABS", "ACOS", "ASIN", "COS", "EXP", "FIX", "FUP", "ROUND", "LN", "SIN",
             "SQRT", "TAN"]


def expression(rng, depth, leaf=number, functions=True):
    """A bracketed expression of a depth, or a leaf."""
    for _ in range(50):
        if depth <= 0:
            return leaf(rng)
        chance = rng.random()
        if functions and chance < 0.3:
            name = rng.choice(FUNCTIONS)
            found = function(rng, name, expression(rng, depth - 1, leaf))
        else:
            terms = [expression(rng, depth - rng.randint(1, 2), leaf)
                     for _ in range(rng.choice([1, 2, 2, 3, 4]))]
            found = flat(rng, terms)
            if found:
                found = (f"[{found[0]}]", found[1])
        if found and len(found[0]) < 90:
            return found
    return leaf(rng)
