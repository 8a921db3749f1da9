package colonnade.unit

import chisel3._
import chiseltest._
import colonnade.TestParts._
import colonnade.config.ColonnadeConfig
import colonnade.ray.RayRequest
import colonnade.shading.{BounceUpdate, BouncedRay, PathEnd}
import colonnade.{Packed, TestConfigs}
import org.scalatest.flatspec.AnyFlatSpec

import scala.util.Random

/** Each bounce updates its path and sends its ray once, in the same cycle; one with a Fresnel reflection does so when
  * it resumes, and sends the reflection before.
  */
class BounceSchedulerSpec extends AnyFlatSpec with ChiselScalatestTester {
  behavior of "BounceScheduler"

  private val environment = TestConfigs.withEnvironment(TestConfigs.environment)
  private val gathering   = TestConfigs.gathering(environment)
  for (
    (config, where) <- Seq(
      TestConfigs.tiny                        -> "",
      environment                             -> ", with an environment",
      gathering                               -> ", of paths that gather",
      TestConfigs.gathering(TestConfigs.tiny) -> ", of paths that gather without an environment"
    )
  )
    it should s"issue every bounce once$where" in
      test(new BounceSchedulerHarness(config)) { dut =>
        dut.clock.setTimeout(0)
        for ((enabled, willing) <- Seq((false, 1.0), (true, 0.8), (true, 0.5)))
          new Bounces(dut, config, new Random(7), enabled && config.hasEnvironment).run(cycles = 400, willing)
      }
}

/** Packs each payload into one port. */
private class BounceSchedulerHarness(config: ColonnadeConfig) extends Module {
  private val unit = Module(new BounceScheduler(config)).io

  val io      = IO(chiselTypeOf(unit))
  val in      = IO(Input(UInt(unit.in.bits.getWidth.W)))
  val update  = IO(Output(UInt(unit.update.bits.getWidth.W)))
  val ray     = IO(Output(UInt(unit.ray.bits.getWidth.W)))
  val stored  = unit.environment.map(environment => IO(Output(UInt(environment.ray.bits.getWidth.W))))
  val leaving = IO(Output(UInt(unit.leaves.ray.bits.getWidth.W)))
  io :<>= unit
  unit.in.bits                                                   := in.asTypeOf(unit.in.bits)
  update                                                         := unit.update.bits.asUInt
  ray                                                            := unit.ray.bits.asUInt
  for (stored <- stored; environment <- unit.environment) stored := environment.ray.bits.asUInt
  leaving                                                        := unit.leaves.ray.bits.asUInt
}

private class Bounces(dut: BounceSchedulerHarness, config: ColonnadeConfig, random: Random, enabled: Boolean) {
  private type Fields = Map[String, BigInt]

  private val bounced = new Packed(new BouncedRay(config))
  private val update  = new Packed(new BounceUpdate(config))
  private val ray     = new Packed(new RayRequest(config))
  private val most    = 2

  /** Bounces to issue, by context; those whose reflection is resolved, and what it shows. */
  private var waiting  = Map.empty[Int, Fields]
  private var deferred = Set.empty[Int]
  private var resumed  = Map.empty[Int, PathEnd.Type]
  private var offered  = Option.empty[Int]
  private val counts   = Array.fill(config.units.pathContexts)(0)
  private val straight = Array.fill(config.units.pathContexts)(false)
  private val gathered = Array.fill(config.units.pathContexts)(false)
  private var issued   = 0
  private var untraced = 0

  dut.io.shading.bounces.get.poke(most)
  dut.io.environment.foreach(_.enabled.poke(enabled))

  def run(cycles: Int, willing: Double): Unit = {
    for (context <- counts.indices) step(Some(context), willing = 0, offers = false)
    for (_ <- 0 until cycles) {
      val idle = counts.indices.filterNot(waiting.contains)
      step(idle.filter(_ => random.nextInt(8) == 0).headOption, willing, offers = true)
    }
    for (_ <- 0 until 60) step(None, willing = 1, offers = false)
    assert(waiting.isEmpty && issued > cycles / 10 && untraced > issued / 20, s"$issued bounces, $untraced not traced")
  }

  private def step(start: Option[Int], willing: Double, offers: Boolean): Unit = {
    def isWilling = random.nextDouble() < willing
    dut.io.start.valid.poke(start.nonEmpty)
    for (context <- start) {
      dut.io.start.bits.poke(context)
      counts(context) = 0
    }
    val idle = counts.indices.filterNot(context => waiting.contains(context) || start.contains(context))
    if (offers && offered.isEmpty && idle.nonEmpty && isWilling) {
      val context = idle(random.nextInt(idle.size))
      straight(context) = counts(context) == 0 && random.nextBoolean()
      gathered(context) = dut.io.path.nonEmpty && random.nextBoolean()
      val fields = bounced.unpack(BigInt(bounced.width, random)) ++
        Map("bounce.context" -> BigInt(context), "bounce.fresnel" -> BigInt(random.nextInt(2) * random.nextInt(4097)))
      waiting += context -> fields
      offered = Some(context)
      dut.in.poke(bounced.pack(fields))
    }
    for (path <- dut.io.path; context <- offered) {
      path.isStraight.poke(straight(context))
      path.isScattered.poke(gathered(context))
    }
    dut.io.in.valid.poke(offered.nonEmpty)
    val (takesUpdate, takesRay) = (isWilling, isWilling)
    dut.io.update.ready.poke(takesUpdate)
    dut.io.ray.ready.poke(takesRay)
    val resumes = deferred.headOption.filter(_ => isWilling)
    val isMiss  = random.nextBoolean()
    val end     = if (!isMiss) PathEnd.lit else if (random.nextBoolean()) PathEnd.cube else PathEnd.background
    for (resume <- dut.io.environment.map(_.resume)) {
      resume.valid.poke(resumes.nonEmpty)
      resume.bits.context.poke(resumes.getOrElse(0))
      resume.bits.end.poke(end)
    }

    val isIssued = takesUpdate && dut.io.update.valid.peekBoolean()
    val reflects = dut.io.environment.exists(_.fresnelReflection.valid.peekBoolean())
    dut.io.bounced.valid.expect(isIssued)
    dut.io.environment.foreach(_.ray.valid.expect(isIssued || reflects))
    dut.io.leaves.ray.valid.expect(isIssued || reflects)
    if ((isIssued || reflects) && !(takesRay && dut.io.ray.valid.peekBoolean()))
      dut.io.leaves.mayBypass.expect(true, "what is not traced is announced")
    if (isIssued) issue(update.unpack(dut.update.peekInt()), takesRay)
    else assert(!(takesRay && dut.io.ray.valid.peekBoolean()))
    if (reflects) defer()
    for (context <- resumes if dut.io.environment.get.resume.ready.peekBoolean()) {
      deferred -= context
      resumed += context -> end
    }
    if (offered.nonEmpty && dut.io.in.ready.peekBoolean()) {
      assert(offered.exists(context => !waiting.contains(context) || deferred(context)), "a bounce is lost")
      offered = None
    }
    dut.clock.step()
  }

  /** The update leaves, and with it the ray, as long as the path has bounces left. */
  private def issue(fields: Fields, takesRay: Boolean): Unit = {
    val context  = fields("context").toInt
    val bounce   = waiting(context)
    val wasAside = hasReflection(context, bounce)
    assert(!wasAside || resumed.contains(context))
    for (name <- Seq("isTinted") ++ Seq("r", "g", "b").map(channel => s"albedo.$channel"))
      assert(fields(name) == bounce(name), name)
    assert(fields("fresnel") == fresnel(context, bounce))
    val isFirst = if (dut.io.path.isEmpty) counts(context) == 0 else straight(context)
    assert(fields("isFirst") == (if (isFirst) 1 else 0))
    assert(fields("reflection") == resumed.getOrElse(context, PathEnd.background).litValue)

    val isTraced     = counts(context) < most
    val isRefraction = bounce("bounce.isRefraction") == 1
    dut.io.bounced.bits.context.expect(context)
    dut.io.bounced.bits.isTraced.expect(isTraced)
    // It enters glass, or is reflected inside
    dut.io.bounced.bits.isInside.expect((bounce("isTinted") == 1) == isRefraction)
    dut.io.isRefraction.expect(isRefraction)
    dut.io.ray.valid.expect(isTraced)
    assert(!isTraced || takesRay, "the ray leaves with the update")
    val expected = way(bounce, "bounce.origin", "bounce.dir")
    if (isTraced) {
      val sent = ray.unpack(dut.ray.peekInt())
      assert(sent == expected ++ Map("context" -> BigInt(context), "isShadow" -> BigInt(0)))
      counts(context) += 1
    } else untraced += 1
    for (port <- dut.stored.toSeq :+ dut.leaving) checkStored(port, context, expected)
    for (environment <- dut.io.environment)
      environment.marches.expect(!gathered(context), "a path that has gathered marches no more")
    waiting -= context
    resumed -= context
    issued += 1
  }

  private def defer(): Unit = {
    val context = offered.get
    val bounce  = waiting(context)
    assert(hasReflection(context, bounce) && !deferred(context))
    dut.io.environment.get.fresnelReflection.bits.expect(context)
    for (port <- dut.stored.toSeq :+ dut.leaving)
      checkStored(port, context, way(bounce, "fresnelOrigin", "bounce.reflection"))
    deferred += context
  }

  private def hasReflection(context: Int, bounce: Fields): Boolean = enabled && fresnel(context, bounce) != 0

  /** A path that has gathered has no Fresnel reflection. */
  private def fresnel(context: Int, bounce: Fields): BigInt = if (gathered(context)) 0 else bounce("bounce.fresnel")

  private def checkStored(port: UInt, context: Int, expected: Fields): Unit = {
    val found = ray.unpack(port.peekInt())
    assert(found("context") == context)
    for ((name, value) <- expected) assert(found(name) == value, name)
  }

  private def way(bounce: Fields, origin: String, dir: String): Fields = Seq("x", "y", "z").flatMap { axis =>
    Seq(s"origin.$axis" -> bounce(s"$origin.$axis"), s"dir.$axis" -> bounce(s"$dir.$axis"))
  }.toMap
}
