-- Ten questions to a store of bags; the folder of the store is the working folder. See docs/fleet.md.
-- A bag that was marked later has a newer row, and one that was mended another verdict than `error`: these hold.
CREATE VIEW bags AS SELECT DISTINCT ON (bag) * FROM 'index/*.parquet' ORDER BY bag, pushed DESC;
CREATE VIEW verdicts AS
  SELECT DISTINCT ON (build, bag) * FROM read_parquet('verdicts/*/*/*.parquet', hive_partitioning = true)
  ORDER BY build, bag, verdict = 'error';

-- 1 Which alarms stop runs, by program and tool table?
SELECT program, alarm_code, left(tools_sha256, 8) AS tools, count(*) AS runs, min(start) AS first
FROM bags WHERE alarms > 0 GROUP BY ALL ORDER BY runs DESC, program;

-- 2 Which programs are held most?
SELECT program, sum(holds) AS holds, count(*) AS runs, sum(holds) / count(*) AS holds_per_run
FROM bags GROUP BY program HAVING sum(holds) > 0 ORDER BY holds_per_run DESC, program LIMIT 10;

-- 3 What is the least clearance of each machine, and in which program?
SELECT machine, min(least_clearance_mm) AS clearance_mm, arg_min(program, least_clearance_mm) AS program
FROM bags WHERE least_clearance_mm IS NOT NULL GROUP BY machine ORDER BY clearance_mm, machine;

-- 4 How does wear go over time?
SELECT machine, date_trunc('week', start) AS week, avg(wear_mm) AS wear_mm, count(*) AS runs
FROM bags WHERE wear_mm IS NOT NULL GROUP BY ALL ORDER BY machine, week;

-- 5 Which runs have no whole recording?
SELECT bag, machine, run, problem FROM bags WHERE complete = 0 OR outcome IS NULL OR problem IS NOT NULL;

-- 6 Who runs with which feed override, at which hour?
SELECT commander, hour(start) AS hour, avg(feed_override_mean) AS override, count(*) AS runs
FROM bags WHERE feed_override_mean IS NOT NULL GROUP BY ALL ORDER BY commander, hour;

-- 7 How often does a program not come to its end, and with which codes?
SELECT program, count(*) AS runs, count(*) FILTER (outcome IS DISTINCT FROM 'succeeded') AS failed,
  list(DISTINCT error_code) FILTER (error_code > 0) AS codes
FROM bags GROUP BY program HAVING failed > 0 ORDER BY failed / runs DESC, program;

-- 8 How many tool changes and hours has each machine?
SELECT machine, sum(tool_changes) AS tool_changes, sum(duration_s) / 3600 AS hours
FROM bags GROUP BY machine ORDER BY hours DESC;

-- 9 What does each build do differently, by control and firmware?
SELECT verdicts.build, control, firmware, verdict, level, message, field, count(*) AS bags, min_by(bag, start) AS first_bag
FROM verdicts JOIN bags USING (bag) WHERE verdict <> 'reproduced' GROUP BY ALL ORDER BY bags DESC;

-- 10 How long do replays take, and how much memory?
SELECT verdicts.build, count(*) AS bags, sum(seconds) AS seconds, quantile_cont(seconds, 0.99) AS slowest_percent_s,
  max(memory_mb) AS memory_mb
FROM verdicts JOIN bags USING (bag) GROUP BY ALL ORDER BY ALL;
