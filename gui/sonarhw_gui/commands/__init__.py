"""The commands of menus, toolbar and keys."""
