-- A store of bags for DuckDB; the folder of the store is the working folder.
CREATE VIEW index_rows AS SELECT * FROM 'index/*.parquet';
CREATE VIEW verdict_rows AS SELECT * FROM read_parquet('verdicts/*/*/*.parquet', hive_partitioning = true);

-- A bag that was marked later has a newer row, and one that was mended another verdict than `error`: these hold.
CREATE VIEW bags AS SELECT DISTINCT ON (bag) * FROM index_rows ORDER BY bag, pushed DESC;
CREATE VIEW verdicts AS SELECT DISTINCT ON (build, bag) * FROM verdict_rows ORDER BY build, bag, verdict = 'error';
