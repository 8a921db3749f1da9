package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{ColoursRecord, Face, Leaf, LeafRecord, RecordFormats}
import colonnade.ray.TracedRay
import colonnade.shading.Occlusion
import colonnade.traversal.TriangleHit
import colonnade.{Always, Model, Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Each hit that is shaded comes with its own ray, details and attributes, however rays, results and records overtake
  * each other.
  */
class PathHitsSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers {
  behavior of "PathHits"

  for ((contexts, colours, instances) <- Seq((5, true, 0), (40, false, 0), (12, false, 2)))
    it should s"join hits with rays and attributes, $contexts contexts${if (colours) ", colours"
      else ""}${if (instances > 0) ", while visits read rays" else ""}" taggedAs Always.unless(contexts == 40) in {
      val tiny   = TestConfigs.tiny
      val config = tiny.copy(
        units = tiny.units.copy(pathContexts = contexts),
        geometry = tiny.geometry.copy(cornerColours = colours),
        frame = tiny.frame.copy(instances = instances)
      )
      test(new PathHitsHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val driver = new PathHitsDriver(dut, config, new Random(contexts))
        driver.run(traces = 400)
        driver.shaded should be > 100
        if (colours) driver.refused should be > 2
        driver.measured should be > 40
        if (instances > 0) driver.visited should be > 100
      }
    }
}

/** Random bits for rays and hits, and those that are expected and found, as integers. */
private class PathHitsHarness(config: ColonnadeConfig) extends Module {
  private val unit = Module(new PathHits(config))

  val io         = IO(chiselTypeOf(unit.io))
  val ray        = IO(Input(chiselTypeOf(unit.io.rays.bits.ray.asUInt)))
  val hit        = IO(Input(chiselTypeOf(unit.io.results.bits.hit.asUInt)))
  val id         = IO(Input(chiselTypeOf(unit.io.results.bits.hit.id)))
  val forHit     = IO(Output(UInt()))
  val details    = IO(Output(UInt()))
  val t          = IO(Output(SInt()))
  val foundRay   = IO(Output(UInt()))
  val foundHit   = IO(Output(UInt()))
  val foundFace  = IO(Output(UInt()))
  val visitRay   = unit.io.worldRays.map(port => IO(Output(UInt())))
  private val of = ray.asTypeOf(new TracedRay(config.numbers))
  private val at = Wire(new TriangleHit(config))
  io :<>= unit.io
  unit.io.trace.rays.bits.ray := of
  at                          := hit.asTypeOf(at)
  at.id                       := id
  unit.io.results.bits.hit    := at
  forHit                      := of.forTriangles.asUInt
  details                     := at.point.asUInt
  t                           := at.t.integer
  visitRay.zip(unit.io.worldRays).foreach { case (to, port) => to := port.ray.asUInt }
  foundRay  := unit.io.trace.hits.bits.ray.asUInt
  foundHit  := unit.io.trace.hits.bits.hit.asUInt
  foundFace := unit.io.trace.hits.bits.face.asUInt
}

/** Takes each context round: a ray, its result, its resolution, and its attributes if it is shaded. */
private class PathHitsDriver(dut: PathHitsHarness, config: ColonnadeConfig, random: Random) extends Matchers {
  private val trace    = dut.io.trace
  private val contexts = config.units.pathContexts
  private val formats  = new RecordFormats(config)
  private val coloured = config.geometry.cornerColours

  private object State extends Enumeration { val idle, offered, traced, ended, shading = Value }
  import State._

  private final class Trace {
    var state               = idle
    var ray, details        = BigInt(0)
    var tEntry, t           = BigInt(0)
    var id                  = 0
    var hasHit, isPrimary   = false
    var occlusion           = Occlusion.none
    var endedAt, resolvedAt = -1
  }
  private val all                  = Seq.fill(contexts)(new Trace)
  private val records              = mutable.Map.empty[Int, BigInt]
  private val awaited              = mutable.ArrayBuffer.empty[Int]
  private var offer                = Option.empty[Int]
  private var following            = Option.empty[Int]
  private var measuring            = Option.empty[Int]
  private var readyBefore          = false
  private var resolvedBefore       = Option.empty[Int]
  private var measuredBefore       = Option.empty[Int]
  private var (cycle, done, quiet) = (0, 0, 0)

  /** Hits that were shaded, hits whose colours have an illegal address, and hits whose distance was asked for alone. */
  var (shaded, refused, measured) = (0, 0, 0)

  /** Rays that visits have read, and the one that comes now. */
  var visited          = 0
  private var visitRay = Option.empty[BigInt]

  private val recordCount = 24
  private val wants       = Seq.fill(config.frame.materials)(random.nextBoolean())

  private def chance(times: Int): Boolean = random.nextInt(times) == 0

  private def one(of: Seq[Int]): Option[Int] = Option.when(of.nonEmpty)(of(random.nextInt(of.size)))

  private def in(states: State.Value): Seq[Int] = all.indices.filter(all(_).state == states)

  def run(traces: Int): Unit = {
    dut.clock.setTimeout(0)
    dut.io.scene.recordCount.poke(recordCount)
    dut.io.wantsColours.foreach(_.zip(wants).foreach { case (port, wants) => port.poke(wants) })
    dut.io.start.poke(true)
    dut.clock.step()
    dut.io.start.poke(false)
    while (done < traces) {
      quiet should be < 300
      step()
    }
  }

  private def step(): Unit = {
    readRay()
    offerRay()
    val result   = offerResult()
    val resolved = resolve()
    answerRequests()
    trace.hits.ready.poke(readyBefore)
    readyBefore = !chance(3)
    trace.hitsReadyNext.poke(readyBefore)

    quiet += 1
    takeRay()
    result.foreach { context =>
      trace.control.hasResult.valid.expect(true)
      trace.control.hasResult.bits.expect(context)
      all(context).state = ended
      all(context).endedAt = cycle
    }
    resolved.foreach(checkOutcome)
    checkMeasured()
    takeShaded()
    dut.clock.step()
    cycle += 1
  }

  /** A visit reads the ray of a context that is traced. */
  private def readRay(): Unit = for (port <- dut.io.worldRays) {
    visitRay.foreach(dut.visitRay.get.expect(_))
    visited += visitRay.size
    val context = if (chance(2)) one(in(traced)) else None
    port.context.valid.poke(context.nonEmpty)
    context.foreach(port.context.bits.poke(_))
    visitRay = context.map(all(_).ray)
  }

  private def offerRay(): Unit = {
    if (offer.isEmpty && chance(2)) offer = one(in(idle))
    trace.rays.valid.poke(offer.nonEmpty)
    dut.io.rays.ready.poke(!chance(3))
    for (context <- offer; now = all(context) if now.state == idle) {
      now.state = offered
      now.tEntry = BigInt(config.numbers.entryBits, random)
      trace.rays.bits.context.poke(context)
      trace.rays.bits.enters.poke(!chance(4))
      trace.rays.bits.tEntry.raw.asInstanceOf[UInt].poke(now.tEntry)
      dut.ray.poke(BigInt(dut.ray.getWidth, random))
      now.ray = dut.forHit.peekInt()
    }
  }

  private def takeRay(): Unit = for (context <- offer if trace.rays.ready.peekBoolean()) {
    val now    = all(context)
    val enters = trace.rays.bits.enters.peekBoolean()
    dut.io.rays.valid.expect(enters)
    trace.control.entered.valid.expect(enters)
    trace.control.missesBox.valid.expect(!enters)
    (if (enters) dut.io.rays.bits.context else trace.control.missesBox.bits).expect(context)
    now.hasHit = false
    now.occlusion = Occlusion.none
    now.state = if (enters) traced else ended
    now.endedAt = cycle
    offer = None
  }

  private def offerResult(): Option[Int] = {
    val context = if (chance(3)) one(in(traced)) else None
    val result  = dut.io.results
    result.valid.poke(context.nonEmpty)
    for (context <- context; now = all(context)) {
      now.hasHit = !chance(3)
      now.occlusion = Occlusion.all(random.nextInt(3))
      now.id = random.nextInt(2 * recordCount)
      result.bits.context.poke(context)
      result.bits.hasHit.poke(now.hasHit)
      result.bits.occlusion.poke(now.occlusion)
      for (visit <- result.bits.visit) {
        visit.isNearer.poke(now.hasHit)
        visit.isLast.poke(true)
      }
      // t is never negative
      dut.hit.poke(BigInt(dut.hit.getWidth - 1, random))
      dut.id.poke(now.id)
      now.details = dut.details.peekInt()
      now.t = dut.t.peekInt()
    }
    context
  }

  /** Resolves the context that was announced, and announces the next one. */
  private def resolve(): Option[Int] = {
    val control = trace.control
    val now     = following
    following =
      if (chance(2)) one(in(ended).filter(other => all(other).endedAt < cycle && !now.contains(other))) else None
    control.query.valid.poke(now.nonEmpty)
    control.query.bits.poke(now.getOrElse(0))
    control.queryNext.valid.poke(following.nonEmpty)
    control.queryNext.bits.poke(following.getOrElse(0))
    val shades = now.filter(all(_).hasHit)
    control.startsShading.poke(shades.nonEmpty)
    for (context <- now; other = all(context)) {
      other.isPrimary = random.nextBoolean()
      control.isPrimary.poke(other.isPrimary)
      other.resolvedAt = cycle
      if (shades.isEmpty) retire(other)
      else other.state = shading
    }
    measuring =
      if (shades.isEmpty && chance(2)) one(in(ended).filter(other => all(other).hasHit && all(other).endedAt < cycle))
      else None
    control.readsDistance.valid.poke(measuring.nonEmpty)
    control.readsDistance.bits.poke(measuring.getOrElse(0))
    now
  }

  private def checkOutcome(context: Int): Unit = {
    trace.control.hasHit.expect(all(context).hasHit)
    trace.control.occlusion.expect(all(context).occlusion)
  }

  /** In the cycle after it is resolved or measured, a hit's distance is known. */
  private def checkMeasured(): Unit = {
    val hit = trace.surfaceHit
    hit.valid.expect(resolvedBefore.nonEmpty)
    for (context <- resolvedBefore; now = all(context)) {
      hit.bits.context.expect(context)
      hit.bits.isPrimary.expect(now.isPrimary)
      hit.bits.id.expect(now.id)
    }
    for (context <- resolvedBefore ++ measuredBefore; now = all(context)) {
      val steps = if (config.numbers.gridFraction >= 0) now.tEntry << config.numbers.gridFraction
      else now.tEntry >> -config.numbers.gridFraction
      hit.bits.distance.get.expect(steps + now.t)
    }
    measured += measuredBefore.size
    measuredBefore = measuring
    resolvedBefore = all.indices.find(index => all(index).state == shading && all(index).resolvedAt == cycle)
  }

  /** Broadcasts requested records, in any order. */
  private def answerRequests(): Unit = {
    val banks    = dut.io.broadcasts
    val answered = if (chance(2)) one(awaited.toSeq) else None
    banks.foreach(_.valid.poke(false))
    for (address <- answered; broadcast = banks(address % banks.size)) {
      awaited -= address
      broadcast.valid.poke(true)
      broadcast.bits.address.poke(address)
      broadcast.bits.record.poke(records.getOrElseUpdate(address, BigInt(formats.recordBits, random)))
      broadcast.bits.row.poke(config.array.rows)
    }
    dut.io.requests.ready.poke(!chance(3))
    if (dut.io.requests.ready.peekBoolean() && dut.io.requests.valid.peekBoolean())
      awaited += dut.io.requests.bits.address.peekInt().toInt
  }

  private def takeShaded(): Unit = {
    if (trace.attributeError.valid.peekBoolean()) {
      val now = all(trace.attributeError.bits.peekInt().toInt)
      now.state shouldBe shading
      (coloured && wantsColours(records(now.id / 2))) shouldBe true
      now.id / 2 + 1 should be >= recordCount
      refused += 1
      retire(now)
    }
    if (trace.hits.valid.peekBoolean()) {
      val now = all(trace.hits.bits.context.peekInt().toInt)
      now.state shouldBe shading
      val leaf = records(now.id / 2)
      dut.foundRay.expect(now.ray)
      dut.foundHit.expect(now.details)
      if (now.id % 2 == 0 || (leaf >> 254) % 4 != 1) checkFace(leaf, now.id) // a triangle has no second one
      shaded += 1
      retire(now)
    }
  }

  /** The face of a leaf by the model; the low bits of the face are those of its material, above them are its colours.
    */
  private def checkFace(leaf: BigInt, id: Int): Unit = {
    val words    = Seq.tabulate(LeafRecord.recordBits(config.geometry) / 32)(i => (leaf >> (32 * i)) & 0xffffffffL)
    val question = Seq(BigInt(id % 2) +: words)
    val face     = new Packed(new Face(config)).unpack(dut.foundFace.peekInt())
    val model    = Model.leaves(config, question, "leafface").head
    val names    = (0 until 3).map(i => s"normals[$i]") :+ "geometricNormal"
    ("material" +: names.flatMap(name => "xyz".map(axis => s"$name.$axis"))).map(face) shouldBe model
    if (coloured && wantsColours(leaf)) {
      val colours = new Packed(new ColoursRecord).unpack(records(id / 2 + 1))
      for (((second, first), i) <- Leaf.corners.zipWithIndex; channel <- "rgb")
        face(s"colours[$i].$channel") shouldBe colours(s"colours[${if (id % 2 == 1) second else first}].$channel")
    }
  }

  /** The material's index is truncated to the bits of the table. */
  private def wantsColours(leaf: BigInt): Boolean =
    wants(new Packed(LeafRecord.triangle(config.geometry)).unpack(leaf)("material").toInt % wants.size)

  private def retire(now: Trace): Unit = {
    now.state = idle
    done += 1
    quiet = 0
  }
}
