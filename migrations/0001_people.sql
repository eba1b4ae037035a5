-- Who takes part.
--
-- Every table is STRICT: a column holds the type it declares, nothing else. Times are
-- milliseconds since 1970 in UTC and say so in their name. Rules have names, because a broken
-- rule is reported by its name.

-- A person who answers, or a program that answers in a person's place. Names are how a labeler
-- comes back from another browser, so there is one row per name, whatever its capitals.
create table labeler (
    id            integer primary key,
    name          text    not null collate nocase,
    created_at_ms integer not null,
    constraint labeler_name_unique    unique (name),
    constraint labeler_name_not_empty check (length(trim(name)) between 1 and 80)
) strict;

-- The server itself answers "skip" to a query whose clips cannot be drawn.
insert into labeler (id, name, created_at_ms) values (1, '(server)', 0);

-- Secrets that stand for rights. Only their SHA-256 is kept: whoever reads this file cannot use
-- them.
--   access   may use a server that listens on more than this machine
--   labeler  the cookie of one browser of one labeler
--   teacher  a program that may read the task rewards of one run's queries
create table token (
    hash          blob    primary key,
    kind          text    not null,
    labeler_id    integer references labeler (id),
    run_id        integer,
    created_at_ms integer not null,
    constraint token_kind_known     check (kind in ('access', 'labeler', 'teacher')),
    constraint token_is_a_sha256    check (length(hash) = 32),
    constraint token_labeler_named  check ((kind in ('labeler', 'teacher')) = (labeler_id is not null)),
    constraint token_run_named      check ((kind = 'teacher') = (run_id is not null))
) strict, without rowid;
