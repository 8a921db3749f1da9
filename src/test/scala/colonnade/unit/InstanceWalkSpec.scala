package colonnade.unit

import chisel3._
import chisel3.util.{Decoupled, Valid}
import chiseltest._
import colonnade.TestParts._
import colonnade.config.{ColonnadeConfig, PathConfig}
import colonnade.formats.ObjectInstance
import colonnade.instance.{InstanceCase, InstanceStimulus, WorldRay}
import colonnade.ray.{PreparedRay, RaySetup}
import colonnade.shading.Occlusion
import colonnade.{Model, Packed, Proofs, Simulation, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec
import org.scalatest.matchers.should.Matchers

import scala.collection.mutable
import scala.util.Random

/** Payloads as integers. */
private class InstanceWalkHarness(config: ColonnadeConfig) extends Module {
  private val walk  = Module(new InstanceWalk(config)).io
  private val setup = Module(RaySetup(config)).io

  val count         = IO(Input(chiselTypeOf(walk.scene.instances.get)))
  val root          = IO(Input(chiselTypeOf(walk.scene.root)))
  val instances     = IO(Input(UInt(walk.instances.getWidth.W)))
  val rays          = IO(Flipped(Decoupled(UInt(walk.rays.bits.getWidth.W))))
  val objectRays    = IO(Decoupled(UInt(walk.rays.bits.getWidth.W)))
  val objectResults = IO(chiselTypeOf(walk.objectResults))
  val results       = IO(Valid(UInt(walk.results.bits.getWidth.W)))

  walk.scene               := 0.U.asTypeOf(walk.scene)
  walk.scene.root          := root
  walk.scene.instances.get := count
  walk.instances           := instances.asTypeOf(walk.instances)

  private val worldRays = SyncReadMem(config.units.pathContexts, chiselTypeOf(walk.worldRays.ray))
  when(walk.rays.fire && !walk.rays.bits.visit.get.valid) {
    worldRays.write(walk.rays.bits.context, walk.rays.bits.ray.forTriangles)
  }
  private val read = walk.worldRays.context
  walk.worldRays.ray := worldRays.read(read.bits, read.valid)

  // Rays in the axes of objects come back by ray set-up, before those of the world
  setup.request :<>= walk.requests
  setup.bounds    := 0.U.asTypeOf(setup.bounds)
  walk.rays.valid := setup.ray.valid || rays.valid
  walk.rays.bits  := rays.bits.asTypeOf(walk.rays.bits)
  walk.rays.bits.visit.foreach(_.valid := false.B)
  when(setup.ray.valid) { walk.rays.bits := setup.ray.bits }
  setup.ray.ready       := walk.rays.ready
  rays.ready            := walk.rays.ready && !setup.ray.valid
  objectRays.valid      := walk.objectRays.valid
  objectRays.bits       := walk.objectRays.bits.asUInt
  walk.objectRays.ready := objectRays.ready
  walk.objectResults    := objectResults
  results.valid         := walk.results.valid
  results.bits          := walk.results.bits.asUInt
}

/** However traversal units accept rays and return results: each ray is traced in the instances whose boxes it enters,
  * one after the other, ends once, and has the nearest hit, of equal ones that of the first instance; a shadow ray ends
  * at an opaque triangle.
  */
class InstanceWalkSpec extends AnyFlatSpec with ChiselScalatestTester with Matchers with Proofs {
  behavior of "InstanceWalk"

  private val config = TestConfigs.withInstances(TestConfigs.tiny, 3)

  it should "trace rays in three, two and one instances, and forward them without any" in
    test(new InstanceWalkHarness(config)).withAnnotations(Simulation.verilator) { dut =>
      for ((instances, rays) <- Seq(3 -> 50, 0 -> 20, 2 -> 30, 1 -> 20))
        withClue(s"$instances instances: ")(new InstanceWalkDriver(dut, config, instances).run(rays))
    }

  it should "resolve each visit once, for any hits, and results in any order" in {
    val narrow = TestConfigs.withInstances(TestConfigs.withPrecision(16, 16, 16), 3)
    prove(
      new InstanceResultsProof(
        narrow.copy(
          geometry = narrow.geometry.copy(vertexBits = 10, triangleBits = Some(16)),
          units = narrow.units.copy(pathContexts = 2)
        ),
        limit = 17
      )
    )
  }
}

/** Sends rays, plays the traversal units, and follows each ray by the model. */
private class InstanceWalkDriver(dut: InstanceWalkHarness, config: ColonnadeConfig, instances: Int) extends Matchers {
  private val numbers  = config.numbers
  private val random   = new Random(instances)
  private val stimulus = new InstanceStimulus(config, random)
  private val rayBits  = new Packed(new PreparedRay(PathConfig(config)))
  private val hitBits  = new Packed(new TraceResult(config))
  private val middle   = stimulus.rayInside()
  private val objects  = Seq.fill(config.frame.instances)(stimulus.through(middle))
  private val boxes    =
    Seq.tabulate(config.frame.instances)(i => if (i == 2) stimulus.box() else InstanceStimulus.wholeCube)

  /** A ray on its way; `expected` is what it is next seen as at the traversal units, or at the end. */
  private final class Trace(val context: Int, ray: WorldRay, tMax: BigInt, isShadow: Boolean) {
    private var (instance, limit) = (0, tMax)
    private var best              = Map.empty[String, BigInt]
    private var occlusion         = 0
    private var worldT            = BigInt(0)
    private val entry             = BigInt(numbers.entryBits, random)
    var result                    = Map.empty[String, BigInt]
    var expected                  = Map.empty[String, BigInt]
    var isOver                    = false
    private var nearest           = Map.empty[String, BigInt]
    private val enters            = {
      val requests = boxes.map { case (low, high) => (ray.numbers :+ tMax) ++ low ++ high }
      Model.answers(config, requests, "instancebox").map(_.head == 1)
    }

    val payload: Map[String, BigInt] = ray.fields("ray") ++
      Map("context" -> BigInt(context), "isShadow" -> bit(isShadow), "tMax" -> tMax, "tEntry" -> entry)

    /** The next instance whose cube the ray enters. */
    def follow(): Unit =
      if (instances == 0) {
        result = anyResult(stimulus.distance())
        expected = Map("root" -> BigInt(77), "tMax" -> tMax, "tEntry" -> entry)
      } else if (instance == instances || occlusion == 2) finish()
      else if (!enters(instance)) {
        instance += 1
        follow()
      } else {
        val beyond   = stimulus.distance()
        val inObject = stimulus.answers(Seq(InstanceCase(ray, limit, objects(instance), beyond))).head
        inObject.entry match {
          case Some((tEntry, t)) =>
            result = anyResult(beyond)
            worldT = t
            val left = inObject.limit - (if (numbers.gridFraction >= 0) tEntry << numbers.gridFraction
                                         else tEntry >> -numbers.gridFraction)
            val most = (BigInt(1) << (numbers.gridBits - 1)) - 1
            expected = Map("root" -> rootOf(instance), "tMax" -> left.max(0).min(most), "tEntry" -> tEntry)
          case None =>
            instance += 1
            follow()
        }
      }

    /** The result of the instance has come. */
    def resolve(): Unit =
      if (instances == 0) {
        best = result
        occlusion = result("occlusion").toInt
        finish()
      } else {
        if (isShadow) occlusion = occlusion.max(result("occlusion").toInt)
        else if (result("hasHit") == 1 && worldT < limit) {
          limit = worldT
          best = result ++ Map("hit.t" -> worldT, "instance" -> BigInt(instance))
        }
        instance += 1
        follow()
      }

    /** Results before the last one name nearer hits. */
    def seen(found: Map[String, BigInt]): Unit =
      if (found("visit.isNearer") == 1) nearest = found.filter { case (name, _) => name.startsWith("hit.") } +
        ("instance" -> found("visit.instance"))

    private def finish(): Unit = {
      isOver = true
      expected =
        if (isShadow) Map("occlusion" -> BigInt(occlusion)) else Map("hasHit" -> best.getOrElse("hasHit", BigInt(0)))
    }

    /** The nearest hit is the one that was seen. */
    def check(): Unit =
      if (expected.get("hasHit").contains(BigInt(1))) for ((name, value) <- best if nearest.contains(name))
        (name -> nearest(name)) shouldBe (name -> value)

    /** A ray that hits has met an opaque triangle, as far as traversal units know. */
    private def anyResult(t: BigInt): Map[String, BigInt] = {
      val occlusion = if (isShadow) random.nextInt(5).min(2) else 2 * random.nextInt(4).min(1)
      Map(
        "context"        -> BigInt(context),
        "hasHit"         -> bit(occlusion == 2),
        "occlusion"      -> BigInt(occlusion),
        "hit.t"          -> t,
        "hit.id"         -> BigInt(8, random),
        "hit.weights[1]" -> BigInt(9, random),
        "hit.backSide"   -> BigInt(1, random)
      )
    }
  }

  def run(rays: Int): Unit = {
    val traces                              = mutable.Map.empty[Int, Trace]
    val held                                = mutable.ArrayBuffer.empty[Trace]
    var offer                               = Option.empty[Trace]
    var (started, done, visits, hits, idle) = (0, 0, 0, 0, 0)
    val all                                 = new Packed(Vec(config.frame.instances, new ObjectInstance(config)))
    dut.instances.poke(all.pack(objects.zipWithIndex.map { case (each, i) =>
      each.fields(s"[$i]") + (s"[$i].root" -> rootOf(i)) ++
        boxes(i)._1.zip("xyz").map { case (value, axis) => s"[$i].box.low.$axis" -> value } ++
        boxes(i)._2.zip("xyz").map { case (value, axis) => s"[$i].box.high.$axis" -> value }
    }.reduce(_ ++ _)))
    dut.count.poke(instances)
    dut.root.poke(77)
    dut.clock.setTimeout(0)
    while (done < rays || idle < 100) {
      idle += 1
      idle should be < 2000
      val free = (0 until config.units.pathContexts).filterNot(context => traces.contains(context))
      if (offer.isEmpty && started < rays && free.nonEmpty && random.nextInt(3) == 0) {
        val ray  = if (random.nextInt(3) == 0) stimulus.ray() else middle
        val tMax = if (random.nextBoolean()) stimulus.distance() else stimulus.farthest
        offer = Some(new Trace(free(random.nextInt(free.size)), ray, tMax, random.nextInt(3) == 0))
        started += 1
      }
      dut.rays.valid.poke(offer.nonEmpty)
      offer.foreach(trace => dut.rays.bits.poke(rayBits.pack(trace.payload)))
      dut.objectRays.ready.poke(random.nextBoolean())
      val resolved = Option.when(held.nonEmpty && random.nextInt(5) == 0)(held.remove(random.nextInt(held.size)))
      dut.objectResults.valid.poke(resolved.nonEmpty)
      for (trace <- resolved) {
        poke(trace.result)
        trace.resolve()
      }
      if (offer.nonEmpty && dut.rays.ready.peekBoolean()) {
        val trace = offer.get
        trace.follow()
        traces(trace.context) = trace
        offer = None
      }
      if (dut.objectRays.valid.peekBoolean() && dut.objectRays.ready.peekBoolean()) {
        val trace = expect(traces, rayBits.unpack(dut.objectRays.bits.peekInt()), isOver = false)
        held should not contain trace
        held += trace
        visits += 1
        idle = 0
      }
      val result = Option.when(dut.results.valid.peekBoolean())(hitBits.unpack(dut.results.bits.peekInt()))
      for (found <- result) traces(found("context").toInt).seen(found)
      for (found <- result if found("visit.isLast") == 1) {
        val trace = expect(traces, found, isOver = true)
        trace.check()
        hits += trace.expected.getOrElse("hasHit", BigInt(0)).toInt
        traces -= trace.context
        done += 1
        idle = 0
      }
      dut.clock.step()
    }
    done shouldBe rays
    hits should be > rays / 30
    visits should be > rays / 4
  }

  private def poke(result: Map[String, BigInt]): Unit = {
    val port = dut.objectResults.bits
    port.context.poke(result("context"))
    port.hasHit.poke(result("hasHit") == 1)
    port.occlusion.poke(Occlusion.all(result("occlusion").toInt))
    port.hit.id.poke(result("hit.id"))
    port.hit.backSide.poke(result("hit.backSide") == 1)
    port.hit.t.raw.asInstanceOf[SInt].poke(result("hit.t"))
    port.hit.weights(1).raw.asInstanceOf[UInt].poke(result("hit.weights[1]"))
  }

  /** The trace of the context, which is to be seen here, with these numbers. */
  private def expect(traces: mutable.Map[Int, Trace], found: Map[String, BigInt], isOver: Boolean): Trace = {
    val trace = traces(found("context").toInt)
    trace.isOver shouldBe isOver
    withClue(s"$found: ")(trace.expected.foreach { case (name, value) =>
      (name -> found(name)) shouldBe (name -> value)
    })
    trace
  }

  private def rootOf(instance: Int): BigInt = BigInt(100 + 9 * instance)

  private def bit(flag: Boolean): BigInt = BigInt(if (flag) 1 else 0)
}
