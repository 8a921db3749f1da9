package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Valid}
import chiseltest._
import colonnade.TestParts._
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.{RecordBroadcast, RecordFormats, SceneMap}
import colonnade.ray.{PreparedRay, SetupCase, SetupRequest}
import colonnade.shading.Occlusion
import colonnade.traversal.TriangleLanes
import colonnade.{Packed, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.collection.mutable
import scala.util.Random

/** Each ray gets its closest hit, or what occludes it, once: that of a search through all triangles, whatever the
  * latency of records and the order of results.
  */
class TraversalUnitSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "TraversalUnit"

  private val tiny = TestConfigs.tiny

  private def traces(config: ColonnadeConfig, name: String): Unit =
    it should s"find the hit of every ray: $name" in
      test(new TraversalUnitHarness(config)).withAnnotations(Simulation.verilator) { dut =>
        val met = for ((willing, seed, isIllegal) <- Seq((1.0, 1, false), (0.3, 2, false), (0.7, 3, true)))
          yield new RayTracing(dut, config, seed, isIllegal).run(willing)
        assert(met.flatten.count(_ == Occlusion.opaque) > 9)
        assert(!config.frame.hasBounces || met.flatten.contains(Occlusion.transmissive))
      }

  traces(
    tiny.copy(array = tiny.array.copy(contexts = 8), units = tiny.units.copy(pathContexts = 20)),
    "a tree, eight contexts, snooping"
  )
  traces(
    TestConfigs.withPrecision(16, 16, 32).copy(
      array = tiny.array.copy(contexts = 1),
      geometry = tiny.geometry.copy(bvh = false),
      columnBvhMemory = tiny.columnBvhMemory.copy(snooping = false, banks = 1),
      frame = tiny.frame.copy(maxBounces = 0),
      units = tiny.units.copy(pathContexts = 3)
    ),
    "no tree, one context, no snooping"
  )
  traces(
    tiny.copy(
      array = tiny.array.copy(rows = 2, contexts = 3),
      geometry = tiny.geometry.copy(cornerColours = true),
      units = tiny.units.copy(pathContexts = 5, triangleRows = 2, triangleLanes = 2)
    ),
    "triangle units of a group, colours"
  )
}

/** Packs rays and results into one port each; adds triangle units. */
private class TraversalUnitHarness(config: ColonnadeConfig) extends Module {
  private val unit = Module(new TraversalUnit(config)).io

  val scene      = IO(Input(UInt(unit.scene.getWidth.W)))
  val start      = IO(Input(Bool()))
  val rays       = IO(Flipped(Valid(UInt(unit.rays.bits.getWidth.W))))
  val isFree     = IO(Output(Bool()))
  val results    = IO(Decoupled(UInt(unit.results.bits.getWidth.W)))
  val requests   = IO(chiselTypeOf(unit.requests))
  val broadcasts = IO(Flipped(Vec(config.columnBvhMemory.banks, Valid(new RecordBroadcast(config)))))
  val events     = IO(chiselTypeOf(unit.events))

  unit.row        := 0.U
  unit.scene      := scene.asTypeOf(unit.scene)
  unit.start      := start
  unit.rays.valid := rays.valid
  unit.rays.bits  := rays.bits.asTypeOf(unit.rays.bits)
  isFree          := unit.isFree
  requests :<>= unit.requests
  unit.broadcasts    := broadcasts
  results.valid      := unit.results.valid
  results.bits       := unit.results.bits.asUInt
  unit.results.ready := results.ready
  events             := unit.events
  unit.triangleLanes :<>= Module(new TriangleLanes(config)).io
}

/** Traces random rays in a small scene.
  *
  * @param isIllegal
  *   a node and the address of a leaf are illegal: their triangles are not found
  */
private class RayTracing(dut: TraversalUnitHarness, config: ColonnadeConfig, seed: Int, isIllegal: Boolean) {
  import TriangleSearch.Fields

  private val random   = new Random(seed)
  private val numbers  = config.numbers
  private val formats  = new RecordFormats(config)
  private val contexts = config.array.contexts
  private val banks    = config.columnBvhMemory.banks

  // The scene
  private val made   = new SmallScene(config, seed, wide = 8, high = 8, triangleCount = 15, shadows = true)
  private val bounds = made.registers
  private val beyond = bounds("scene.recordCount").toInt
  private val node   = new Packed(formats.node)

  /** A node whose children are leaves, and those leaves. */
  private val brokenNode = Option.when(isIllegal && config.geometry.bvh)(1)
  private val lostLeaves = brokenNode.toSeq.flatMap { address =>
    val fields = node.unpack(made.records(address))
    val first  = fields("first").toInt
    made.leafAddresses.dropWhile(_ < first).take(fields("leaves").toInt)
  }
  private val end     = if (isIllegal) beyond - 1 else beyond
  private val records = made.records.zipWithIndex.map {
    case (record, address) if brokenNode.contains(address) => node.pack(node.unpack(record) + ("leaves" -> 7))
    case (record, _)                                       => record
  }

  private val search              = new TriangleSearch(config, made)
  private val (triangles, isLost) = search.triangles.map { case (address, triangle) =>
    triangle -> (address >= end || lostLeaves.contains(address))
  }.unzip
  private val found = triangles.zip(isLost).collect { case (triangle, false) => triangle }

  // Rays, as the model prepares them, and their hits
  private def steps(units: BigInt): BigInt =
    if (numbers.gridFraction >= 0) units << numbers.gridFraction else units >> -numbers.gridFraction
  private val cube = BigInt(1) << numbers.vertexBits

  private def request(): SetupRequest = {
    val Seq(a, b, c) = triangles(random.nextInt(triangles.size)).vertices
    val (u, v)       = (random.nextInt(60), random.nextInt(60))
    val target       = Seq(0, 1, 2).map(axis => steps((a(axis) * (120 - u - v) + b(axis) * u + c(axis) * v) / 120))
    val origin       = Seq.fill(3)(steps(cube) * (random.nextInt(300) - 100) / 100)
    val isShadow     = random.nextInt(3) == 0
    val length       = if (isShadow) 60 + random.nextInt(100) else 100
    SetupRequest(0, isShadow, origin, target.zip(origin).map { case (to, from) => (to - from) * length / 100 })
  }
  private val rays: Vector[(SetupRequest, Fields)] = {
    val Seq(low, high) = Seq("low", "high").map(side => Seq("x", "y", "z").map(axis => bounds(s"bounds.$side.$axis")))
    val requests       = Seq.fill(120)(request())
    val prepared       = SetupCase(low, high, requests).answers(config).map(RayTracing.prepared)
    requests.zip(prepared).toVector.collect {
      case (request, ray) if ray("enters") == 1 => request -> (ray + ("isShadow" -> (if (request.isShadow) 1 else 0)))
    }
  }

  /** By ray: occlusion of a shadow ray, or the fields of its closest hit. */
  private val expected: Vector[(Occlusion.Type, Option[Fields])] = search.hits(rays.map(_._2), found)

  private val packedRay = new Packed(new PreparedRay(PathConfig(config)))
  private val result    = new Packed(new TraceResult(PathConfig(config)))
  private val inFlight  = Seq.fill(banks)(mutable.Queue.empty[(Int, Int, Int)]) // (due, address, row)

  /** The ray of each context of the path unit that is traced. */
  private val traced       = mutable.Map.empty[Int, Int]
  private var now          = 0
  private var maxTraced    = 0
  private var enteredCount = 0
  private var hasIllegal   = false

  dut.clock.setTimeout(0)
  dut.scene.poke(new Packed(new SceneMap(config)).pack(bounds.collect {
    case (name, value) if name.startsWith("scene.") => name.stripPrefix("scene.") -> value
  } + ("recordCount" -> BigInt(end))))
  dut.start.poke(true)
  dut.clock.step()
  dut.start.poke(false)

  /** @param willing probability that a port is ready or valid in a cycle
    * @return what occludes each ray
    */
  def run(willing: Double): Seq[Occlusion.Type] = {
    def isWilling              = random.nextDouble() < willing
    var (sent, answered, idle) = (0, 0, 0)
    while (answered < rays.size) {
      val takesRequest = isWilling
      val takesResult  = isWilling
      val context      = random.nextInt(config.units.pathContexts)
      broadcast()
      dut.requests.ready.poke(takesRequest)
      dut.results.ready.poke(takesResult)
      val sends = sent < rays.size && !traced.contains(context) && dut.isFree.peekBoolean() && isWilling
      dut.rays.valid.poke(sends)
      if (sends) dut.rays.bits.poke(packedRay.pack(rays(sent)._2 + ("context" -> context)))

      idle += 1
      assert(idle < 2000, s"nothing happens after $answered rays")
      if (takesRequest && dut.requests.valid.peekBoolean()) take(dut.requests.bits.address.peekInt().toInt)
      if (takesResult && dut.results.valid.peekBoolean()) {
        check(result.unpack(dut.results.bits.peekInt()))
        answered += 1
        idle = 0
      }
      if (sends) {
        traced(context) = sent
        sent += 1
      }
      maxTraced = maxTraced.max(traced.size)
      countEvents()
      step()
    }
    dut.rays.valid.poke(false)
    dut.results.ready.poke(true)
    for (_ <- 0 until 40) {
      broadcast()
      dut.results.valid.expect(false)
      countEvents()
      step()
    }
    dut.isFree.expect(true)
    // Results wait in a queue and in the test
    assert(maxTraced >= contexts, "all contexts are used")
    assert(enteredCount == rays.size && hasIllegal == (isIllegal && config.geometry.bvh))
    assert(expected.count(_._2.nonEmpty) > rays.size / 5)
    expected.map(_._1)
  }

  private def step(): Unit = {
    dut.clock.step()
    now += 1
  }

  private def countEvents(): Unit = {
    if (dut.events.intersector.raysInBox.peekBoolean()) enteredCount += 1
    if (dut.events.intersector.illegalRecord.peekBoolean() || dut.events.fetch.illegalRecord.peekBoolean())
      hasIllegal = true
    dut.events.intersector.stackOverflow.expect(false)
  }

  private def check(fields: Fields): Unit = {
    val ray              = traced.remove(fields("context").toInt).get
    val (occlusion, hit) = expected(ray)
    if (rays(ray)._1.isShadow) assert(
      fields("occlusion") == occlusion.litValue,
      s"shadow ray $ray, seed $seed: ${fields("occlusion")} for $occlusion"
    )
    else {
      assert(fields("hasHit") == hit.size, s"ray $ray, seed $seed")
      for (hit <- hit; (name, value) <- hit) assert(fields(s"hit.$name") == value, s"$name of ray $ray, seed $seed")
    }
  }

  private def take(address: Int): Unit = {
    assert(address < end)
    inFlight(address % banks).enqueue((now + 1 + random.nextInt(5), address, 0))
  }

  /** Reads of this row, and of other rows, which read the same scene. */
  private def broadcast(): Unit = for (bank <- 0 until banks) {
    val port = dut.broadcasts(bank)
    if (random.nextInt(5) == 0) {
      val address = random.nextInt(records.size) / banks * banks + bank
      if (address < records.size) inFlight(bank).enqueue((now + 1 + random.nextInt(5), address, 1))
    }
    val isDue = inFlight(bank).headOption.exists(_._1 <= now)
    port.valid.poke(isDue)
    if (isDue) {
      val (_, address, reader) = inFlight(bank).dequeue()
      port.bits.address.poke(address)
      port.bits.record.poke(records(address))
      port.bits.row.poke(reader)
    }
  }
}

private object RayTracing {

  /** Fields of a [[PreparedRay]] from the model's answer to `setup`, in whose order the origin in units is left out. */
  def prepared(answer: Seq[BigInt]): Map[String, BigInt] = {
    val values                                                   = answer.iterator
    def next(name:    String): (String, BigInt)                  = name -> values.next()
    def several(name: String, count: Int): Seq[(String, BigInt)] = (0 until count).map(i => next(s"$name[$i]"))
    val fields = Seq(next("enters"), next("ray.orientation.axis")) ++ several("ray.orientation.negative", 3) ++
      several("ray.origin", 3) ++ several("units", 3) ++ several("ray.shear", 2) ++ several("ray.reciprocal", 2) ++
      several("ray.exponent", 2) ++ Seq(next("tEntry"), next("tMax"))
    fields.filterNot(_._1.startsWith("units")).toMap
  }
}
