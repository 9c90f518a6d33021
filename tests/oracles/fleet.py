#!/usr/bin/env python3
"""Asks a store of bags the ten questions of fleet.sql, with DuckDB.

    fleet.py STORE BAGS

BAGS is how many bags the store has; each has one verdict. Another reader of Parquet must find the same.
"""

import os
import pathlib
import sys

import duckdb


def main() -> None:
    store, count = sys.argv[1], int(sys.argv[2])
    sql = (pathlib.Path(__file__).parent / "fleet.sql").read_text()
    os.chdir(store)
    connection = duckdb.connect()
    questions = []
    for statement in duckdb.extract_statements(sql):
        answer = connection.execute(statement)
        if statement.type == duckdb.StatementType.SELECT:
            questions.append(answer.fetchall())
    assert len(questions) == 10, f"{len(questions)} questions"

    def one(query: str):
        return connection.execute(query).fetchone()

    assert one("SELECT count(*) FROM 'index/*.parquet'") == (count,), "rows of the index"
    assert one("SELECT count(*), count(DISTINCT bag) FROM verdicts") == (count, count), "verdicts"
    kinds = dict(connection.execute("SELECT column_name, column_type FROM (DESCRIBE bags)").fetchall())
    for column, kind in [("bag", "VARCHAR"), ("start", "TIMESTAMP WITH TIME ZONE"), ("holds", "BIGINT"), ("wear_mm", "DOUBLE")]:
        assert kinds[column] == kind, f"{column} is {kinds[column]}"
    # The generated runs have each of these, so the questions have answers.
    for number, answer in enumerate(questions, 1):
        print(f"question {number}: {len(answer)} rows; {answer[0] if answer else 'nothing'}")
    for number in (1, 2, 3, 4, 6, 7, 8, 10):
        assert questions[number - 1], f"question {number} has no answer"
    for bag, machine, run, problem in questions[4]:
        raise SystemExit(f"{bag} ({machine}, {run}) is not whole: {problem}")
    assert sum(row[1] for row in questions[9]) == count
    print(f"{len(questions)} passed, 0 failed")


if __name__ == "__main__":
    main()
