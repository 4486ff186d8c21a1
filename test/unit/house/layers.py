"""The layers within the rooms: the contracts of import-linter, as pyproject.toml has them."""

from house import ROOT
from importlinter.application.use_cases import read_user_options
from importlinter.configuration import configure

configure()
# by package, from the top down; exhaustive: whoever adds a part to the package has to name it
LAYERS = {
    contract['containers'][0]: contract['layers']
    for contract in read_user_options(str(ROOT / 'pyproject.toml')).contracts_options
    if contract['type'] == 'layers' and contract.get('exhaustive') == 'True'
}
