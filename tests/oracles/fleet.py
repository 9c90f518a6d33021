#!/usr/bin/env python3
"""Asks a store of bags the ten questions of fleet.sql, with DuckDB and with DataFusion.

    fleet.py STORE BAGS

BAGS is how many bags the store has; each has one verdict. Both engines must answer alike.
"""

import math
import os
import pathlib
import sys

import datafusion
import duckdb

HERE = pathlib.Path(__file__).parent


def statements(name: str) -> list[str]:
    """The statements of a file, without its comments."""
    lines = (HERE / name).read_text().splitlines()
    text = "\n".join(line for line in lines if not line.startswith("--"))
    return [statement.strip() for statement in text.split(";") if statement.strip()]


def alike(one, other) -> bool:
    """Whether two answers are the same; engines add up in another order."""
    if isinstance(one, float) and isinstance(other, (float, int)):
        return math.isclose(one, other, rel_tol=1e-9)
    if isinstance(one, (list, tuple)):
        return len(one) == len(other) and all(map(alike, one, other))
    return one == other


def rows(answer: list) -> list[tuple]:
    """Rows with sets in one order, and times without a time zone."""

    def plain(value):
        if isinstance(value, list):
            return sorted(value)
        return value.timestamp() if hasattr(value, "timestamp") else value

    return [tuple(plain(value) for value in row) for row in answer]


def main() -> None:
    store, count = sys.argv[1], int(sys.argv[2])
    questions = statements("fleet.sql")
    assert len(questions) == 10, f"{len(questions)} questions"
    os.chdir(store)
    duck, fusion = duckdb.connect(), datafusion.SessionContext()
    for statement in statements("fleet_duckdb.sql"):
        duck.execute(statement)
    for statement in statements("fleet_datafusion.sql"):
        fusion.sql(statement).collect()

    def one(query: str):
        return duck.execute(query).fetchone()

    assert one("SELECT count(*) FROM index_rows") == (count,), "rows of the index"
    assert one("SELECT count(*), count(DISTINCT bag) FROM verdicts") == (count, count), "verdicts"
    kinds = dict(duck.execute("SELECT column_name, column_type FROM (DESCRIBE bags)").fetchall())
    for column, kind in [("bag", "VARCHAR"), ("start", "TIMESTAMP WITH TIME ZONE"), ("holds", "BIGINT"), ("wear_mm", "DOUBLE")]:
        assert kinds[column] == kind, f"{column} is {kinds[column]}"
    answers = []
    for number, question in enumerate(questions, 1):
        answer = rows(duck.execute(question).fetchall())
        other = rows([tuple(row.values()) for row in fusion.sql(question).to_pylist()])
        assert alike(answer, other), f"question {number}: DuckDB says {answer[:3]}, DataFusion {other[:3]}"
        print(f"question {number}: {len(answer)} rows; {answer[0] if answer else 'nothing'}")
        answers.append(answer)
    # The generated runs have each of these, so the questions have answers.
    for number in (1, 2, 3, 4, 6, 7, 8, 10):
        assert answers[number - 1], f"question {number} has no answer"
    for bag, machine, run, problem in answers[4]:
        raise SystemExit(f"{bag} ({machine}, {run}) is not whole: {problem}")
    assert sum(row[1] for row in answers[9]) == count
    print(f"{len(answers)} questions answered alike by both engines")


if __name__ == "__main__":
    main()
