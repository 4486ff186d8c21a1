// @ts-check
// What no page can be.

export const NO_EMERGENCY_STOP = 'This page is no emergency stop: '
  + 'keep the robot\u2019s own within reach.';
