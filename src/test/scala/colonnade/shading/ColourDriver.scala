package colonnade.shading

import chisel3._
import chiseltest._
import colonnade.config.ColonnadeConfig
import colonnade.formats.{CubeTexel, Rgb}
import colonnade.numbers.Fixed
import colonnade.numbers.FixedPorts._

import scala.collection.mutable
import scala.util.Random

/** What happens to a context, in this order: a path starts, bounces and ends. */
sealed trait ColourEvent

object ColourEvent {
  case object Start                           extends ColourEvent
  final case class Remember(what: LitColours) extends ColourEvent

  /** @param light of the cube, which the Fresnel reflection meets */
  final case class Bounce(
      albedo:     Seq[Int],
      isTinted:   Boolean,
      fresnel:    Int,
      hasSurface: Boolean,
      light:      Option[Seq[Int]] = None
  ) extends ColourEvent

  /** @param occlusions by light, 0: none, 1: transmissive, 2: opaque */
  final case class End(isBackground: Boolean, occlusions: Seq[Int], isDirectView: Boolean) extends ColourEvent

  /** A surface that gathers light; a path ends in light of the cube. */
  final case class Gather(occlusions: Seq[Int]) extends ColourEvent
  final case class EndInCube(light: Seq[Int])   extends ColourEvent

  /** The ray that a point of the room gathers ends, in light of the cube or else at a surface; then that point. */
  final case class GoBack(light: Option[Seq[Int]], occlusions: Seq[Int]) extends ColourEvent
  final case class EndWithGathered(occlusions: Seq[Int])                 extends ColourEvent
}

/** A surface: albedo, direct light of each light, emission. */
final case class LitColours(albedo: Seq[Int], direct: Seq[Seq[Int]], emission: Seq[Int])

/** Random paths. */
final class ColourScript(config: ColonnadeConfig, random: Random) {
  import ColourEvent._

  private val one = 4096

  /** Lights that are on. */
  var lights: Int = config.frame.lights

  private def xyz(value: => Int): Seq[Int] = Seq.fill(3)(value)

  private def colour(): Seq[Int] =
    xyz(if (random.nextInt(4) == 0) random.nextInt(2) * 4095 else random.nextInt(4096))

  private var ambient = Seq.empty[Int]

  private def intensity(): Seq[Int] =
    xyz(if (random.nextInt(6) == 0) 65535 else random.nextInt(6) * random.nextInt(1800))

  /** Light of the cube: mantissas with a common exponent, or a light. */
  private def cubeLight(): Seq[Int] =
    if (random.nextInt(6) == 0) xyz(65535)
    else {
      val exponent = random.nextInt(10)
      xyz(random.nextInt(128) << exponent)
    }

  /** So dark that what a point of the environment gathers may be more than twice as bright. */
  private def darkness(): Seq[Int] = xyz(random.nextInt(200))

  /** Ambient light, background, transmittance for shadow rays. */
  def registers(): (Seq[Int], Seq[Int], Int) = {
    ambient = random.nextInt(4) match {
      case 0 => darkness()
      case 1 => xyz(0)
      case _ => intensity()
    }
    (ambient, colour(), random.nextInt(one + 1))
  }

  /** Some lights are as bright as the ambient light, which gives a ratio of exactly one half. */
  def surface(): LitColours = {
    val isDark  = random.nextInt(3) == 0
    def light() = if (random.nextInt(3) == 0) ambient else if (isDark) darkness() else intensity()
    LitColours(
      colour(),
      Seq.tabulate(config.frame.lights)(index => if (index < lights) light() else xyz(0)),
      if (random.nextBoolean()) colour() else xyz(0)
    )
  }

  def path(): Seq[ColourEvent] = {
    val bounces = if (config.frame.hasBounces) random.nextInt(4) else 0
    val kind    = if (config.frame.gather) random.nextInt(if (config.gathersInRoom) 3 else 2) else 0
    if (kind == 0) Start +: Seq.fill(bounces)(bounce()).flatten ++: end(mayBeDirect = bounces == 0)
    else {
      val steps = Seq.fill(bounces)(if (random.nextBoolean()) bounce(mayReflect = kind == 1) else gather()).flatten
      if (kind == 2) {
        val light = Option.when(random.nextBoolean())(cubeLight())
        (Start +: steps) ++ Seq(
          Remember(surface()),
          GoBack(light, occlusions()),
          Remember(surface()),
          EndWithGathered(occlusions())
        )
      } else
        Start +: steps ++: gather() ++:
          (if (random.nextBoolean()) Seq(EndInCube(cubeLight())) else end(mayBeDirect = false))
    }
  }

  private def gather(): Seq[ColourEvent] = Seq(Remember(surface()), Gather(occlusions()))

  private def bounce(mayReflect: Boolean = true): Seq[ColourEvent] = {
    val hasSurface = config.hasEnvironment && mayReflect && random.nextBoolean()
    val fresnel    = if (!mayReflect || random.nextBoolean()) 0 else random.nextInt(one + 1)
    val meetsCube  =
      Option.when(config.gathersInRoom && !hasSurface && fresnel > 0 && random.nextBoolean())(cubeLight())
    Seq(Remember(surface())).filter(_ => hasSurface) :+
      Bounce(colour(), random.nextBoolean(), fresnel, hasSurface, meetsCube)
  }

  private def occlusions(): Seq[Int] = {
    val kinds = if (config.frame.hasBounces) 3 else 2
    Seq.fill(config.frame.lights)(if (random.nextBoolean()) 0 else 2 - random.nextInt(kinds - 1))
  }

  private def end(mayBeDirect: Boolean): Seq[ColourEvent] = {
    val occlusions   = this.occlusions()
    val isDirectView = config.hasEnvironment && mayBeDirect && random.nextBoolean()
    if (random.nextInt(4) == 0) Seq(End(isBackground = true, occlusions, isDirectView = false))
    else Seq(Remember(surface()), End(isBackground = false, occlusions, isDirectView))
  }
}

/** Plays the events of every context on the ports of a colour unit. Each port takes the next event of any context. */
final class ColourDriver(io: ColourUnitIO, config: ColonnadeConfig) {
  import ColourEvent._

  private val contexts = config.units.pathContexts
  private val todo     = Seq.fill(contexts)(mutable.Queue.empty[ColourEvent])
  private val waits    = Array.fill(contexts)(Option.empty[ColourEvent])

  /** The light of the cube on its way to the unit: five cycles after its request. */
  private var requested = Seq.fill(5)(Option.empty[Seq[Int]])

  /** By context, whether its path has not bounced. */
  private val isStraight = Array.fill(contexts)(true)

  /** By context, the colours and shadow ratios of its paths. */
  val colours = Seq.fill(contexts)(mutable.ArrayBuffer.empty[(Seq[Int], Option[Seq[Int]])])

  def enqueue(events: Seq[Seq[ColourEvent]]): Unit = todo.zip(events).foreach { case (queue, more) => queue ++= more }

  def isDone: Boolean = todo.forall(_.isEmpty) && waits.forall(_.isEmpty)

  def registers(values: (Seq[Int], Seq[Int], Int), lights: Int = config.frame.lights): Unit = {
    io.shading.lights.poke(lights)
    poke(io.ambient, values._1)
    pokeUInt(io.background, values._2)
    io.shading.shadowTransmittance.foreach(_.pokeRaw(values._3))
  }

  /** One cycle. */
  def act(random: Random, stalls: Double): Unit = {
    def next[E <: ColourEvent](of: PartialFunction[ColourEvent, E]): Option[(Int, E)] = {
      val able = (0 until contexts).filter(c => waits(c).isEmpty && todo(c).headOption.exists(of.isDefinedAt))
      Option.when(able.nonEmpty && random.nextDouble() >= stalls) {
        val context = able(random.nextInt(able.size))
        (context, of(todo(context).head))
      }
    }
    val start    = next { case Start => Start }
    val remember = next { case it: Remember => it }
    val bounce   = next { case it: Bounce => it }
    val end      = next {
      case it: End             => it
      case it: Gather          => it
      case it: EndInCube       => it
      case it: GoBack          => it
      case it: EndWithGathered => it
    }

    start.foreach { case (context, _) => isStraight(context) = true }
    io.surface.valid.poke(remember.nonEmpty)
    for ((context, Remember(what)) <- remember) {
      io.surface.bits.context.poke(context)
      pokeUInt(io.surface.bits.albedo, what.albedo)
      io.surface.bits.directLight.zip(what.direct).foreach { case (port, value) => poke(port, value) }
      io.surface.bits.emission.foreach(pokeUInt(_, what.emission))
    }
    for (port <- io.bounce) {
      port.valid.poke(bounce.nonEmpty)
      for ((context, Bounce(albedo, isTinted, fresnel, hasSurface, light)) <- bounce) {
        port.bits.context.poke(context)
        port.bits.isFirst.poke(isStraight(context))
        pokeUInt(port.bits.albedo, albedo)
        port.bits.isTinted.poke(isTinted)
        port.bits.fresnel.pokeRaw(fresnel)
        port.bits.reflection.poke(if (hasSurface) PathEnd.lit else beyond(light))
      }
    }
    io.end.valid.poke(end.nonEmpty)
    val isScattered = random.nextBoolean()
    for ((context, event) <- end) {
      val dark               = Seq.fill(config.frame.lights)(0)
      val (kind, occlusions) = event match {
        case End(true, occlusions, _)       => (PathEnd.background, occlusions)
        case End(false, occlusions, isSeen) => (if (isSeen) PathEnd.directView else PathEnd.lit, occlusions)
        case Gather(occlusions)             => (PathEnd.gathers, occlusions)
        case GoBack(light, occlusions)      => (light.fold(PathEnd.lit)(_ => PathEnd.cube), occlusions)
        case EndWithGathered(occlusions)    => (PathEnd.gathered, occlusions)
        case _                              => (PathEnd.cube, dark)
      }
      io.end.bits.context.poke(context)
      io.end.bits.end.poke(kind)
      io.end.bits.goesBack.poke(event.isInstanceOf[GoBack])
      io.end.bits.isStraight.foreach(_.poke(isStraight(context)))
      io.end.bits.occlusions.zip(occlusions).foreach { case (port, what) => port.poke(Occlusion.all(what)) }
      io.end.bits.isScattered.poke(isScattered)
    }
    // The light stays until the next one comes
    if (config.frame.gather) {
      val cube = io.cube
      requested.last.foreach(light => pokeTexel(cube.texel, light))
      val reader = cube.read.bits.context.peekInt().toInt
      val light  = (end ++ bounce).find(_._1 == reader).flatMap { case (_, event) => lightOf(event) }
      val reads  = cube.read.valid.peekBoolean()
      for (_ <- light if reads) {
        val isReflection = bounce.exists(_._1 == reader)
        cube.read.bits.isReflection.expect(isReflection)
        cube.read.bits.seesLights.expect(isReflection || !isScattered)
      }
      requested = Option.when(reads)(light.getOrElse(throw new AssertionError("no light is needed"))) +: requested.init
    }

    // What was taken
    if (io.colour.valid.peekBoolean()) {
      val context = io.colour.bits.context.peekInt().toInt
      val ended   = waits(context).getOrElse(throw new AssertionError(s"context $context has not ended"))
      val ratio   = io.colour.bits.ratio.filter { _ =>
        ended match {
          case End(isBackground, _, isDirectView) => isDirectView && !isBackground
          case other                              => other.isInstanceOf[EndWithGathered]
        }
      }
      colours(context) +=
        (io.colour.bits.colour.channels.map(_.peekInt().toInt) -> ratio.map(_.channels.map(_.peekRaw().toInt)))
      waits(context) = None
    }
    if (io.continued.valid.peekBoolean()) {
      val context = io.continued.bits.context.peekInt().toInt
      val isBack  = io.continued.bits.goesBack.peekBoolean()
      assert(waits(context).exists(event => if (isBack) event.isInstanceOf[GoBack] else event.isInstanceOf[Gather]))
      waits(context) = None
      isStraight(context) = false
    }
    (start ++ remember).foreach { case (context, _) => todo(context).dequeue() }
    for ((context, _) <- bounce if io.bounce.get.ready.peekBoolean()) {
      todo(context).dequeue()
      isStraight(context) = false
    }
    for ((context, ended) <- end if io.end.ready.peekBoolean()) {
      todo(context).dequeue()
      waits(context) = Some(ended)
    }
  }

  private def beyond(light: Option[Seq[Int]]): PathEnd.Type = light.fold(PathEnd.background)(_ => PathEnd.cube)

  /** The light of the cube that a path meets. */
  private def lightOf(event: ColourEvent): Option[Seq[Int]] = event match {
    case EndInCube(light)          => Some(light)
    case GoBack(light, _)          => light
    case Bounce(_, _, _, _, light) => light
    case _                         => None
  }

  private def poke(port: Rgb[Fixed], values: Seq[Int]): Unit =
    port.channels.zip(values).foreach { case (channel, value) => channel.pokeRaw(value) }

  private def pokeTexel(port: CubeTexel, light: Seq[Int]): Unit = {
    val isLight  = light.forall(_ == 65535)
    val exponent = (0 to 9).find(exponent => light.forall(value => (value >> exponent) < 128)).getOrElse(0)
    port.isLight.poke(isLight)
    port.exponent.poke(exponent)
    pokeUInt(port.mantissas, light.map(value => (value >> exponent) & 127))
  }

  private def pokeUInt(port: Rgb[UInt], values: Seq[Int]): Unit =
    port.channels.zip(values).foreach { case (channel, value) => channel.poke(value) }
}
