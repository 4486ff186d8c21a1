"""The PR2's subsystems: perception, planning, skills, for a simulated robot or a real one."""
