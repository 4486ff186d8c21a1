// @ts-check
// The page begins here, with the list of its panels.
import { App } from './page/app.js';
import { people } from './people/people_panel.js';
import { questions } from './questions/question_panel.js';
import { fleet } from './robots/fleet_panel.js';
import { machines } from './robots/machine_panel.js';
import { sensors } from './sensors/sensor_panel.js';
import { trials } from './trials/trial_panel.js';

new App([questions, fleet, machines, sensors, trials, people]).connection.connect();
