-- Ten questions to a store of bags, for any engine: `bags` and `verdicts` are made by fleet_duckdb.sql or
-- fleet_datafusion.sql. See docs/fleet.md.

-- 1 Which alarms stop runs, by program and tool table?
SELECT program, alarm_code, left(tools_sha256, 8) AS tool_table, count(*) AS runs, min(start) AS first
FROM bags WHERE alarms > 0 GROUP BY program, alarm_code, tool_table ORDER BY runs DESC, program, alarm_code, tool_table;

-- 2 Which programs are held most?
SELECT program, sum(holds) AS holds, count(*) AS runs, sum(holds) * 1.0 / count(*) AS holds_per_run
FROM bags GROUP BY program HAVING sum(holds) > 0 ORDER BY holds_per_run DESC, program LIMIT 10;

-- 3 What is the least clearance of each machine, and in which program?
SELECT machine, min(least_clearance_mm) AS clearance_mm, (array_agg(program ORDER BY least_clearance_mm, program))[1] AS program
FROM bags WHERE least_clearance_mm IS NOT NULL GROUP BY machine ORDER BY clearance_mm, machine;

-- 4 How does wear go over time?
SELECT machine, date_trunc('week', start) AS week, avg(wear_mm) AS wear_mm, count(*) AS runs
FROM bags WHERE wear_mm IS NOT NULL GROUP BY machine, week ORDER BY machine, week;

-- 5 Which runs have no whole recording?
SELECT bag, machine, run, problem FROM bags WHERE complete = 0 OR outcome IS NULL OR problem IS NOT NULL;

-- 6 Who runs with which feed override, at which hour?
SELECT commander, extract(hour FROM start) AS hour, avg(feed_override_mean) AS override, count(*) AS runs
FROM bags WHERE feed_override_mean IS NOT NULL GROUP BY commander, hour ORDER BY commander, hour;

-- 7 How often does a program not come to its end, and with which codes?
SELECT program, count(*) AS runs, count(*) FILTER (WHERE outcome IS DISTINCT FROM 'succeeded') AS failed,
  array_agg(DISTINCT error_code) FILTER (WHERE error_code > 0) AS codes
FROM bags GROUP BY program HAVING count(*) FILTER (WHERE outcome IS DISTINCT FROM 'succeeded') > 0
ORDER BY failed * 1.0 / runs DESC, program;

-- 8 How many tool changes and hours has each machine?
SELECT machine, sum(tool_changes) AS tool_changes, sum(duration_s) / 3600 AS hours
FROM bags GROUP BY machine ORDER BY hours DESC, machine;

-- 9 What does each build do differently, by control and firmware?
SELECT verdicts.build, control, firmware, verdict, level, message, field, count(*) AS bags,
  (array_agg(bag ORDER BY start, bag))[1] AS first_bag
FROM verdicts JOIN bags USING (bag) WHERE verdict <> 'reproduced'
GROUP BY verdicts.build, control, firmware, verdict, level, message, field
ORDER BY bags DESC, control, firmware, level, message, field;

-- 10 How long do replays take, and how much memory?
SELECT verdicts.build, count(*) AS bags, sum(seconds) AS seconds, percentile_cont(0.99) WITHIN GROUP (ORDER BY seconds) AS slowest_percent_s,
  max(memory_mb) AS memory_mb
FROM verdicts JOIN bags USING (bag) GROUP BY verdicts.build ORDER BY verdicts.build;
