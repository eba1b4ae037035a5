-- Studies: fixed pairs that invited people answer.

-- What is asked, and how far it is. The file is kept as it was: a study never changes.
create table study (
    id             integer primary key,
    title          text    not null,
    -- 'preference' or 'same_stage'
    question       text    not null,
    file           text    not null,
    -- where the file lay: query sets are named as seen from there
    folder         text    not null,
    state          text    not null,
    state_message  text    not null,
    state_since_ms integer not null,
    created_at_ms  integer not null,
    constraint study_question_known check (question in ('preference', 'same_stage')),
    -- preparing: clips are drawn · ready: nobody may answer yet · open · closed: unblinded · failed
    constraint study_state_known check (state in ('preparing', 'ready', 'open', 'closed', 'failed'))
) strict;

-- Two kinds of runs belong to a study, and neither trains: one for each task holds its pairs as
-- they were drawn; one for each seat and task holds what one labeler is asked.
alter table run add column study_id integer references study (id);

-- A pair of a study. Its segments and clips are those of its query, which nobody is asked.
create table study_item (
    id       integer primary key,
    study_id integer not null references study (id),
    query_id integer not null references query (id),
    -- number of its task in the study, from 0
    task     integer not null,
    -- which method chose it; null for pairs that no method chose
    method   text,
    -- number of that method in the study, from 0
    method_number integer not null,
    role     text    not null,
    -- the right answer and why, where both are known
    expects  text,
    because  text,
    constraint study_item_has_one_query unique (query_id),
    constraint study_item_role_known check (role in ('counted', 'practice', 'check')),
    constraint study_item_known_answer check ((role = 'counted') = (expects is null))
) strict;

create index study_item_by_study on study_item (study_id, id);

-- A place for one labeler, with the link that leads to it.
create table study_seat (
    id            integer primary key,
    study_id      integer not null references study (id),
    -- from 1; names the labeler in exports
    number        integer not null,
    -- SHA-256 of the secret in the link; used up when somebody enters by it
    invite_hash   blob    not null,
    invited_at_ms integer not null,
    expires_at_ms integer not null,
    invite_used   integer not null default 0,
    -- SHA-256 of the code by which the labeler comes back from elsewhere
    return_hash   blob,
    labeler_id    integer references labeler (id),
    -- when they agreed to the consent text and sat down
    entered_at_ms integer,
    constraint study_seat_numbered unique (study_id, number),
    constraint study_seat_invite_unique unique (invite_hash),
    constraint study_seat_return_unique unique (return_hash),
    constraint study_seat_invite_used_is_a_truth check (invite_used in (0, 1)),
    constraint study_seat_entered_by_somebody check ((labeler_id is null) = (entered_at_ms is null))
) strict;

create index study_seat_by_labeler on study_seat (labeler_id);

-- What one labeler is asked about one task, in the order of the tasks.
create table study_part (
    run_id  integer primary key references run (id),
    seat_id integer not null references study_seat (id),
    task    integer not null,
    constraint study_part_once unique (seat_id, task)
) strict;

-- One question to one labeler: which pair, why, and with which sides.
create table study_turn (
    query_id integer primary key references query (id),
    item_id  integer not null references study_item (id),
    role     text    not null,
    left_is  text    not null,
    constraint study_turn_role_known check (role in ('counted', 'practice', 'check', 'repeat')),
    constraint study_turn_left_known check (left_is in ('first', 'second'))
) strict;
