"""All borders, by name."""

from . import (
    answers,
    console,
    files,
    health_heard,
    messages,
    people_at_robots,
    robot_goals,
    running_machines,
    settings,
    world_services,
)

BORDERS = {
    border.name: border
    for room in (
        settings,
        messages,
        console,
        files,
        answers,
        health_heard,
        people_at_robots,
        robot_goals,
        running_machines,
        world_services,
    )
    for border in room.BORDERS
}
