-- Runs, and what they said.

-- One training run. Its weights and transitions live in its folder; here is what pages show and
-- what people have a part in.
create table run (
    id             integer primary key,
    task           text    not null,
    method         text    not null,
    preset         text    not null,
    seed           integer not null,
    -- 'human', 'http' (a program answers), or the name of a scripted teacher
    teacher        text    not null,
    draws_clips    integer not null,
    -- the resolved settings as TOML, from which any figure can be made again
    config         text    not null,
    -- answers that may be used, skips not counted
    budget         integer not null,
    total_steps    integer not null,
    step           integer not null default 0,
    -- preferences received, skips not counted
    n_labels       integer not null default 0,
    -- 0 where no agent learns: a fixed collection of queries put in from outside
    is_trained     integer not null default 1,
    state          text    not null,
    state_message  text    not null,
    state_next     text    not null,
    state_since_ms integer not null,
    created_at_ms  integer not null,
    constraint run_state_known check (state in ('training', 'waiting_for_labels', 'paused', 'finished', 'stopped', 'failed')),
    constraint run_is_trained_is_a_truth check (is_trained in (0, 1) and draws_clips in (0, 1)),
    constraint run_counts_are_counts check (budget >= 0 and total_steps >= 0 and step >= 0 and n_labels >= 0)
) strict;

-- What happened in a run, in order. A page that lost its connection asks for everything above
-- the last id it saw, so nothing is missed. A run that was killed says some things again; what
-- has a name is kept once.
create table event (
    id     integer primary key autoincrement,
    run_id integer not null references run (id),
    at_ms  integer not null,
    name   text,
    kind   text    not null,
    data   text    not null,
    constraint event_said_once unique (run_id, name),
    constraint event_data_is_json check (json_valid(data))
) strict;

create index event_by_run on event (run_id, id);
