package colonnade.ray

import colonnade.Model
import colonnade.config.ColonnadeConfig

import scala.util.Random

/** A ray to prepare, of the world or in the axes of an instance. */
final case class SetupRequest(
    context:  Int,
    isShadow: Boolean,
    origin:   Seq[BigInt],
    dir:      Seq[BigInt],
    visit:    Option[Int] = None
)

/** An object's box with rays for it, random and directed. */
final case class SetupCase(low: Seq[BigInt], high: Seq[BigInt], requests: Seq[SetupRequest]) {

  /** The model's result of each request; vectors.cpp documents the order of numbers under `setup`. */
  def answers(config: ColonnadeConfig): Seq[Seq[BigInt]] = {
    val questions = requests.map(r => BigInt(if (r.isShadow) 1 else 0) +: (r.origin ++ r.dir ++ low ++ high))
    Model.answers(config, questions, "setup")
  }
}

/** Rays that aim at a box from everywhere, and corner cases of ray set-up. */
final class SetupStimulus(config: ColonnadeConfig, random: Random) {
  private val numbers  = config.numbers
  private val fraction = numbers.gridFraction
  private val cube     = BigInt(1) << numbers.vertexBits

  def all(raysPerBox: Int): Seq[SetupCase] = boxes.map { case (low, high) => aimed(low, high, raysPerBox) }

  /** Boxes whose low plane is above the high one, on one axis or on all: by as much as possible, by as much as the pads
    * make up for, and by one unit more.
    */
  def inverted(raysPerBox: Int): Seq[SetupCase] = {
    val whole  = Seq.tabulate(3)(axis => (Seq.fill(3)(BigInt(0)).updated(axis, cube - 1), axis))
    val most   = whole.map { case (low, axis) => (low, Seq.fill(3)(cube - 1).updated(axis, BigInt(0))) }
    val pads   = BigInt(2) << numbers.boxPadLog
    val slight = Seq(pads, pads + 1).map { by =>
      val axis = random.nextInt(3)
      (
        Seq.fill(3)(BigInt(0)).updated(axis, (cube / 2 + by).min(cube - 1)),
        Seq.fill(3)(cube - 1).updated(axis, cube / 2)
      )
    }
    val any = Seq.fill(3)(Seq.fill(2)(BigInt(numbers.vertexBits, random)).sorted)
    (most ++ slight :+ ((any.map(_.last), any.map(_.head)))).map { case (low, high) =>
      val ordered = low.zip(high).map { case (l, h) => Seq(l, h).sorted }
      aimed(ordered.map(_.head), ordered.map(_.last), raysPerBox).copy(low = low, high = high)
    }
  }

  private def aimed(low: Seq[BigInt], high: Seq[BigInt], rays: Int): SetupCase =
    SetupCase(low, high, extremes(low, high) ++ Seq.fill(rays)(ray(low, high)))

  private def boxes: Seq[(Seq[BigInt], Seq[BigInt])] = {
    val whole = (Seq.fill(3)(BigInt(0)), Seq.fill(3)(cube - 1))
    val flat  = (Seq(cube / 4, cube / 2, BigInt(0)), Seq(3 * cube / 4, cube / 2, cube - 1))
    val point = (Seq.fill(3)(cube - 1), Seq.fill(3)(cube - 1))
    val any   = Seq.fill(3)(Seq.fill(2)(BigInt(numbers.vertexBits, random)).sorted)
    Seq(whole, flat, point, (any.map(_.head), any.map(_.last)))
  }

  private def signed(bits: Int): BigInt = BigInt(bits, random) - (BigInt(1) << (bits - 1))

  private def steps(units: BigInt): BigInt = if (fraction >= 0) units << fraction else units >> -fraction

  private def request(origin: Seq[BigInt], dir: Seq[BigInt]): SetupRequest =
    SetupRequest(random.nextInt(config.units.pathContexts), random.nextBoolean(), origin, dir)

  private def extremes(low: Seq[BigInt], high: Seq[BigInt]): Seq[SetupRequest] = {
    val least  = -(BigInt(1) << (numbers.sceneBits - 1))
    val lowest = -(BigInt(1) << (numbers.directionBits - 1))
    val centre = low.zip(high).map { case (l, h) => steps((l + h) / 2) }
    Seq(
      request(centre, Seq(0, 0, 0)),
      request(centre, Seq(lowest, lowest, lowest)),
      request(centre, Seq(-lowest - 1, 1, -1)),
      request(Seq.fill(3)(least), Seq.fill(3)(-lowest - 1)),
      request(Seq.fill(3)(-least - 1), Seq.fill(3)(lowest)),
      request(Seq(least, -least - 1, least), Seq(-lowest - 1, lowest, -lowest - 1)),
      request(centre.updated(0, least), Seq(1, 0, 0)),
      request(centre.updated(2, -least - 1), Seq(0, 0, -1)),
      request(centre.updated(1, least), Seq(0, -lowest - 1, 1))
    ) ++ leaving(low, high)
  }

  /** Diagonal rays that reach one plane of the padded box about where they leave another one. */
  private def leaving(low: Seq[BigInt], high: Seq[BigInt]): Seq[SetupRequest] =
    for (before <- 0 to 1; behind <- 0 to 2; up <- Seq(true, false)) yield {
      val pad          = BigInt(1) << numbers.boxPadLog
      val (begin, end) = if (up) (low.map(_ - pad - before), high) else (high.map(_ + pad + before), low)
      val sign         = if (up) 1 else -1
      val axis         = 1 + random.nextInt(2)
      val inside       = low.zip(high).map { case (l, h) => (l + h) / 2 }
      val origin       = inside.updated(0, begin.head).updated(axis, end(axis) + sign * (pad + behind))
      request(origin.map(steps), Seq.fill(3)(BigInt(7 * sign)))
    }

  /** A ray at a point in the box, close to it, or anywhere. */
  private def ray(low: Seq[BigInt], high: Seq[BigInt]): SetupRequest = {
    val target = low.zip(high).map { case (l, h) => steps(l) + BigInt(numbers.gridBits, random) % (steps(h - l) + 1) }
    val origin = random.nextInt(4) match {
      case 0 => Seq.fill(3)(signed(numbers.sceneBits))
      case 1 => Seq.fill(3)(signed(numbers.gridBits - 1))
      case 2 => target.map(_ + signed(numbers.gridBits - 2 - random.nextInt(8)))
      case _ => low.zip(high).map { case (l, h) => steps(if (random.nextBoolean()) l else h) }
    }
    val exact   = target.zip(origin).map { case (t, o) => t - o }
    val changed = random.nextInt(6) match {
      case 0 => exact.updated(random.nextInt(3), BigInt(0))
      case 1 => exact.updated(random.nextInt(3), BigInt(random.nextInt(5) - 2))
      case 2 => Seq.fill(3)(exact.head * (random.nextInt(3) - 1))
      case 3 => exact.map(_ + signed(numbers.gridBits - 4))
      case _ => exact
    }
    // A shadow ray ends at its target; others have any length
    val space = numbers.directionBits - 1 - changed.map(_.abs.bitLength).max
    val shift = if (space > 0) random.nextInt(space + 1) else 0
    val dir   = if (random.nextInt(3) == 0) changed.map(_ << shift) else changed
    request(origin, if (random.nextInt(12) == 0) Seq.fill(3)(signed(numbers.directionBits)) else dir)
  }
}
