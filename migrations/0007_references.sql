-- What refers to what is found without reading whole tables.
--
-- SQLite makes an index for every primary key and every unique rule, and none for a column that
-- refers to another table. Two things look such a column up: queries, and SQLite itself, which
-- must know before a row goes whether another still refers to it. Without an index both read the
-- whole table, and these tables grow with every answer.

-- All leases of a question, whatever became of them: the sides that a labeler has seen in a pair
-- are those of the next question about it. The partial index of 0004 holds the open ones alone.
create index lease_by_question on lease (question_id);

-- The questions about a pair of a study: how many labelers have answered it.
create index study_turn_by_item on study_turn (item_id);

-- What shows a clip. A study that is sealed puts padded clips in the place of the drawn ones and
-- removes each that nothing shows any more.
create index query_by_first_clip on query (first_clip);
create index query_by_second_clip on query (second_clip);
create index demonstration_by_clip on demonstration (clip);

-- A program's token names its run, and no rule said that there must be such a run; every other
-- column that names one has this rule. SQLite cannot add a rule to a column, so a new table takes
-- the place of the old one. No other table refers to tokens, so nothing else changes. A token of a
-- run that is not there would break the rule; no program could do anything with it, so it is left
-- behind.
create table token_with_run (
    hash          blob    primary key,
    kind          text    not null,
    labeler_id    integer references labeler (id),
    run_id        integer references run (id),
    created_at_ms integer not null,
    constraint token_kind_known     check (kind in ('access', 'labeler', 'teacher')),
    constraint token_is_a_sha256    check (length(hash) = 32),
    constraint token_labeler_named  check ((kind in ('labeler', 'teacher')) = (labeler_id is not null)),
    constraint token_run_named      check ((kind = 'teacher') = (run_id is not null))
) strict, without rowid;

insert into token_with_run (hash, kind, labeler_id, run_id, created_at_ms)
select hash, kind, labeler_id, run_id, created_at_ms from token
where run_id is null or run_id in (select id from run);

drop table token;
alter table token_with_run rename to token;
