from symgrasp.plan.verify import verify
from symgrasp.planners.planning import plan_bimanual
from tests.conftest import load_small


def test_plans_of_maps_that_search_all_of_the_redundancy_hold():
    scene = load_small("log_two_robots").with_settings(redundancy="auto", approach=0.05)
    report = verify(plan_bimanual(scene))
    assert report, str(report)
