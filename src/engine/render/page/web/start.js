
const about = JSON.parse(element('about').textContent);
if (about.live) {
  const archives = about.archives ?? [about], facts = archives.find(({ title }) => title === Address.read().archive) ?? archives[0];
  window.player = new Player(new Live(facts, facts.file ? new Workers(facts.file) : new Server()));
  window.player.source.archive = facts === archives[0] ? null : facts.title;
  window.steering = new Steering(window.player);
  window.steering.offerArchives(archives.map(({ title }) => title), facts.title);
} else {
  window.player = new Player(new Stored(about));
  window.player.show();
}
