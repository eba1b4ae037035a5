-- What is asked, and the pictures of it.

-- An encoded clip, named by the SHA-256 of its bytes; the bytes lie in the data folder under
-- clips/<first two digits>/<name>.mp4. Equal clips are one clip.
create table clip (
    sha256        text    primary key,
    n_frames      integer not null,
    fps           integer not null,
    width         integer not null,
    height        integer not null,
    n_bytes       integer not null,
    created_at_ms integer not null,
    constraint clip_name_is_a_sha256 check (length(sha256) = 64),
    constraint clip_has_frames       check (n_frames > 0 and fps > 0 and n_bytes > 0)
) strict, without rowid;

-- Two segments put to a labeler. The key (run, session, position) makes asking twice harmless:
-- a run that was killed after storing a session offers the same rows again.
create table query (
    id              integer primary key,
    run_id          integer not null references run (id),
    session         integer not null,
    position        integer not null,
    asks_same_stage integer not null,
    disagreement    real,
    stage_gap       real,
    -- waiting: to be drawn · ready: may be shown · bad: cannot be drawn · unwanted: a program answers
    clip_state      text    not null,
    clip_trouble    text,
    first_clip      text    references clip (sha256),
    second_clip     text    references clip (sha256),
    created_at_ms   integer not null,
    constraint query_key unique (run_id, session, position),
    constraint query_clip_state_known check (clip_state in ('waiting', 'ready', 'bad', 'unwanted')),
    constraint query_ready_has_both_clips check (clip_state != 'ready' or (first_clip is not null and second_clip is not null)),
    constraint query_bad_says_why check ((clip_state = 'bad') = (clip_trouble is not null))
) strict;

create index query_to_draw on query (id) where clip_state = 'waiting';

-- The two windows of a query with all that drawing and judging them takes. Little-endian
-- numbers, row after row: the run's own files may be gone, a query can still be drawn.
create table query_segment (
    query_id     integer not null references query (id),
    which        text    not null,
    episode      integer not null,
    start        integer not null,
    len          integer not null,
    poses        blob    not null, -- f32 [len][pose size]
    task_rewards blob    not null, -- f64 [len]; ground truth, for teachers' programs only
    stages       blob    not null, -- u8 [len], or empty where the task does not know
    primary key (query_id, which),
    constraint query_segment_which_known check (which in ('first', 'second'))
) strict, without rowid;

-- One thing that is asked about a query. Open until it is answered; the stage question is
-- withdrawn when the preference is skipped, for the clips were of no use.
create table question (
    id       integer primary key,
    run_id   integer not null references run (id),
    query_id integer not null references query (id),
    kind     text    not null,
    state    text    not null default 'open',
    constraint question_once        unique (query_id, kind),
    constraint question_kind_known  check (kind in ('preference', 'same_stage')),
    constraint question_state_known check (state in ('open', 'answered', 'withdrawn'))
) strict;

create index question_open on question (run_id, query_id, kind) where state = 'open';

-- An episode of the policy to look at: "how it does now".
create table demonstration (
    id            integer primary key,
    run_id        integer not null references run (id),
    -- the session that was about to be asked; null at the end of the run
    session       integer,
    step          integer not null,
    success       integer not null,
    task_return   real    not null,
    clip          text    not null references clip (sha256),
    created_at_ms integer not null,
    constraint demonstration_success_is_a_truth check (success in (0, 1))
) strict;

create index demonstration_by_run on demonstration (run_id, step);
