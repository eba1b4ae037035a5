-- How the agent does these days: the mean task reward a step over the run's newest complete
-- episodes when the query was asked. Scripted teachers measure by it what is close and what is
-- poor; ground truth, for teachers' programs only. Null for queries of older versions, and
-- before a first episode was complete.
alter table query add column typical_reward real;
