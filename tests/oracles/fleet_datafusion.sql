-- A store of bags for DataFusion; the folder of the store is the working folder.
CREATE EXTERNAL TABLE index_rows STORED AS PARQUET LOCATION 'index/';
CREATE EXTERNAL TABLE verdict_rows STORED AS PARQUET PARTITIONED BY (build, shard) LOCATION 'verdicts/';

-- A bag that was marked later has a newer row, and one that was mended another verdict than `error`: these hold.
CREATE VIEW bags AS SELECT DISTINCT ON (bag) * FROM index_rows ORDER BY bag, pushed DESC;
CREATE VIEW verdicts AS SELECT DISTINCT ON (build, bag) * FROM verdict_rows ORDER BY build, bag, verdict = 'error';
