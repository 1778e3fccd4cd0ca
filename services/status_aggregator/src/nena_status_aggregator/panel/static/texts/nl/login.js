// Dutch texts of logging in and out.

export const LOGIN = {
  "login.title": "Aanmelden",
  "login.intro": "Dit paneel is voor wie een token heeft. Wie NeNa bij u beheert, geeft u er een.",
  "login.token": "Token",
  "login.submit": "Aanmelden",
  "login.wrong": "Niemand heeft dit token. Kijk of het in zijn geheel is gekopieerd.",
  "login.failed": "De statusaggregator antwoordt niet zoals het hoort. Probeer het opnieuw.",
  "login.issuer": "Aanmelden met het account van uw organisatie",
  "login.problem.away": "De aanmelddienst van uw organisatie antwoordt niet. Probeer het later opnieuw, of meld u aan met een token.",
  "login.problem.expired": "Het aanmelden duurde te lang, of is in een ander venster begonnen. Begin opnieuw.",
  "login.problem.refused": "De aanmelddienst van uw organisatie heeft u niet toegelaten.",
  "login.problem.role": "U bent bekend, maar hebt hier geen rol. Wie NeNa bij u beheert, kan u er een laten geven.",
  "login.problem.unfit": "Het antwoord van de aanmelddienst is niet bruikbaar. Wie NeNa bij u beheert, vindt de reden in het log van de statusaggregator.",
  "login.out": "Afmelden",
  "login.as": "Aangemeld als {user}, {role}",
  "login.viewer": "mag kijken",
  "login.operator": "mag opdrachten geven",
  "login.admin": "mag alles",
  "login.noCommands": "U mag kijken, maar geen opdrachten geven. Wie NeNa bij u beheert, kan dat veranderen.",
};
