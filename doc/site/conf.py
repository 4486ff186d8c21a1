"""Sphinx's settings for the site. The pages come from build.py, which puts them into one folder."""

project = 'smach_oracle'
author = 'the authors of smach_oracle'
extensions = ['myst_parser', 'sphinx.ext.autodoc']
root_doc = 'index'
html_theme = 'furo'
html_title = 'smach_oracle'
html_show_sphinx = False
html_copy_source = False
html_static_path = ['static']
html_css_files = ['site.css']
# a found page is fetched, to show the sentence. A browser refuses that where the site is opened as
# a file: build.py --for-files
html_show_search_summary = True
# headings down to #### are targets of links, under the same names as on GitHub
myst_heading_anchors = 4
myst_enable_extensions = ['html_image']
# `name` in a docstring is code
default_role = 'code'
autodoc_member_order = 'bysource'
autodoc_typehints = 'none'
autodoc_default_options = {'members': True, 'show-inheritance': True}
# "" in a comment is an empty text
smartquotes = False
# blocks that show what a program prints are no language
highlight_language = 'text'
suppress_warnings = ['misc.highlighting_failure']
