"""Whether a page grows with the questions that a person opens and leaves: nodes, event listeners
and heap of the browser, by its DevTools protocol. For a test and a benchmark.
"""

import itertools
import statistics
import time

METRICS = {'nodes': 'Nodes', 'listeners': 'JSEventListeners', 'heap bytes': 'JSHeapUsedSize'}
READINGS, PAUSE_S = 3, 0.4
# by keys: open the oldest question, until it is taken and drawn; leave it, until it waits again
OPEN_AND_LEAVE = """
const [times, done] = arguments;
if (!window.realNow) { // what the page holds back for 0.7 s need not be waited for
  window.realNow = performance.now.bind(performance);
  window.leapt = 0;
  performance.now = () => window.realNow() + window.leapt;
}
const press = (key) => window.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
const until = (selector) => new Promise((resolve) => {
  const look = () => (document.querySelector(selector) ? resolve() : setTimeout(look, 20));
  look();
});
(async () => {
  for (let time = 0; time < times; time += 1) {
    await until(".question-row.pending");
    do { // a key is refused for a moment after what it would do has changed
      await new Promise((resolve) => { setTimeout(resolve, 110); });
      window.leapt += 700;
      press("n");
    } while (!document.querySelector(".detail"));
    // a robot on a loaded machine may answer too late: the question is left anyway
    await until(".detail .claim-bar.good, .detail [data-action=claim]");
    await until(".detail .state");
    press("Escape");
  }
  await until(".question-row.pending");
  done();
})();"""


def samples(driver, warm_up, questions, every):
    """Open and leave `warm_up` questions, then so many more; yields (questions since the warm-up,
    numbers by name) after each `every`, and at first.
    """
    driver.set_script_timeout(3600)
    driver.execute_cdp_cmd('Performance.enable', {})
    driver.execute_async_script(OPEN_AND_LEAVE, warm_up)
    yield 0, numbers_of(driver)
    for done in range(every, questions + 1, every):
        driver.execute_async_script(OPEN_AND_LEAVE, every)
        yield done, numbers_of(driver)


def numbers_of(driver):
    """What the browser holds after garbage collection: of each number the least of the readings."""
    readings = []
    for number in range(READINGS):
        time.sleep(PAUSE_S if number else 0.0)  # what is held for a moment is let go meanwhile
        for _ in range(2):
            driver.execute_cdp_cmd('HeapProfiler.collectGarbage', {})
        readings.append(
            {
                metric['name']: metric['value']
                for metric in driver.execute_cdp_cmd('Performance.getMetrics', {})['metrics']
            }
        )
    return {name: min(each[metric] for each in readings) for name, metric in METRICS.items()}


def slopes_of(taken):
    """Growth a question by name, from samples: the median of the slopes between any two of them. A
    sample among them that is off changes it little.
    """
    pairs = [
        (later[0] - earlier[0], earlier[1], later[1])
        for earlier, later in itertools.combinations(taken, 2)
    ]
    return {
        name: statistics.median(
            (later[name] - earlier[name]) / more for more, earlier, later in pairs
        )
        for name in METRICS
    }
