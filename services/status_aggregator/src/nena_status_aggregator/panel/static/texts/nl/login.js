// Dutch texts of logging in and out.

export const LOGIN = {
  "login.title": "Aanmelden",
  "login.intro": "Dit paneel is voor wie een token heeft. Wie NeNa bij u beheert, geeft u er een.",
  "login.token": "Token",
  "login.submit": "Aanmelden",
  "login.wrong": "Niemand heeft dit token. Kijk of het in zijn geheel is gekopieerd.",
  "login.failed": "De statusaggregator antwoordt niet zoals het hoort. Probeer het opnieuw.",
  "login.out": "Afmelden",
  "login.as": "Aangemeld als {user}, {role}",
  "login.viewer": "mag kijken",
  "login.operator": "mag opdrachten geven",
  "login.admin": "mag alles",
  "login.noCommands": "U mag kijken, maar geen opdrachten geven. Wie NeNa bij u beheert, kan dat veranderen.",
};
