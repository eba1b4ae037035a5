-- The submit protocol: leases, answers, and a record of who did what.

-- A question in one labeler's hands for a while. A question is in at most one labeler's hands.
create table lease (
    id            text    primary key,
    question_id   integer not null references question (id),
    labeler_id    integer not null references labeler (id),
    -- which segment is shown on the left; drawn when the lease is granted, never changed
    left_is       text    not null,
    -- open · answered · taken: overdue, and then given to somebody else
    state         text    not null default 'open',
    granted_at_ms integer not null,
    expires_at_ms integer not null,
    constraint lease_left_known  check (left_is in ('first', 'second')),
    constraint lease_state_known check (state in ('open', 'answered', 'taken'))
) strict, without rowid;

create unique index lease_one_open_per_question on lease (question_id) where state = 'open';
create index lease_open_by_labeler on lease (labeler_id, granted_at_ms) where state = 'open';

-- How often the first segment was on the left, less how often the second was. Kept between
-- -1 and 1 by the draw, for each labeler and algorithm.
create table side_balance (
    labeler_id integer not null references labeler (id),
    method     text    not null,
    n_first    integer not null default 0,
    n_second   integer not null default 0,
    primary key (labeler_id, method)
) strict, without rowid;

-- What was answered. Never changed and never removed: who changes their mind adds a row that
-- supersedes the one before. Numbers have no gaps within a run and kind of question, so that a
-- checkpoint can say up to which one it has taken them in.
create table answer (
    id              text    primary key,
    run_id          integer not null references run (id),
    question_id     integer not null references question (id),
    kind            text    not null,
    sequence        integer not null,
    lease_id        text    references lease (id), -- null where the server itself skips
    labeler_id      integer not null references labeler (id),
    left_is         text    not null,
    pressed         text    not null,
    meaning         text    not null,
    reason          text,
    supersedes      text    references answer (id),
    guidance_sha256 text,
    visible_ms      integer,
    hidden_ms       integer,
    loops           real,
    seeks           integer,
    speed           real,
    dropped_frames  integer,
    input           text,
    stored_at_ms    integer not null,
    constraint answer_sequence_unique    unique (run_id, kind, sequence),
    constraint answer_superseded_once    unique (supersedes),
    constraint answer_fits_the_question  check (
        (kind = 'preference' and pressed in ('left', 'right', 'equal', 'skip'))
        or (kind = 'same_stage' and pressed in ('same', 'different', 'skip'))),
    constraint answer_skip_has_a_reason  check (pressed != 'skip' or reason is not null),
    constraint answer_left_known         check (left_is in ('first', 'second')),
    constraint answer_sequence_positive  check (sequence > 0)
) strict;

-- A question has one first answer, whoever gives it.
create unique index answer_first_per_question on answer (question_id) where supersedes is null;
create index answer_by_lease on answer (lease_id);
create index answer_by_question on answer (question_id, sequence);

create trigger answer_is_never_changed before update on answer
begin select raise(abort, 'answers are append-only'); end;
create trigger answer_is_never_removed before delete on answer
begin select raise(abort, 'answers are append-only'); end;

-- Answers to leases that somebody else had taken: kept for whoever wants to look, never used.
create table late_answer (
    lease_id      text    primary key references lease (id),
    labeler_id    integer not null references labeler (id),
    pressed       text    not null,
    body          text    not null,
    received_at_ms integer not null,
    constraint late_answer_body_is_json check (json_valid(body))
) strict, without rowid;

-- Who did what, written in the same transaction as the thing itself.
create table audit (
    id         integer primary key autoincrement,
    at_ms      integer not null,
    labeler_id integer references labeler (id),
    run_id     integer references run (id),
    action     text    not null,
    subject    text    not null,
    detail     text    not null,
    constraint audit_detail_is_json check (json_valid(detail))
) strict;

create trigger audit_is_never_changed before update on audit
begin select raise(abort, 'the audit is append-only'); end;
create trigger audit_is_never_removed before delete on audit
begin select raise(abort, 'the audit is append-only'); end;
