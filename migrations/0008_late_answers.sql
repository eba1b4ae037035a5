-- Every answer that comes too late is kept, not only the first to its lease.
--
-- Who answers without a connection and changes their mind sends two answers to one lease. Where
-- somebody else had the question by then, both are kept aside; sent again they are not kept twice.
create table late_answer_each (
    id             integer primary key,
    lease_id       text    not null references lease (id),
    labeler_id     integer not null references labeler (id),
    pressed        text    not null,
    body           text    not null,
    received_at_ms integer not null,
    constraint late_answer_body_is_json check (json_valid(body)),
    constraint late_answer_kept_once    unique (lease_id, body)
) strict;

insert into late_answer_each (lease_id, labeler_id, pressed, body, received_at_ms)
select lease_id, labeler_id, pressed, body, received_at_ms from late_answer order by received_at_ms, lease_id;

drop table late_answer;
alter table late_answer_each rename to late_answer;

create trigger late_answer_is_never_changed before update on late_answer
begin select raise(abort, 'answers are append-only'); end;
create trigger late_answer_is_never_removed before delete on late_answer
begin select raise(abort, 'answers are append-only'); end;
